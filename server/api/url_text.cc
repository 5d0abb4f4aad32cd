// SPDX-License-Identifier: Apache-2.0
#include "server/api/url_text.h"

#include <algorithm>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/text/utf8.h"

namespace rigcal::server {
namespace {

constexpr size_t kMaxParameters = 64;

int HexDigit(char digit) {
  if (digit >= '0' && digit <= '9') return digit - '0';
  const char lower = absl::ascii_tolower(static_cast<unsigned char>(digit));
  return lower >= 'a' && lower <= 'f' ? lower - 'a' + 10 : -1;
}

}  // namespace

std::optional<std::string> DecodeUrlText(std::string_view text, bool plus_is_space) {
  std::string decoded;
  decoded.reserve(text.size());
  for (size_t i = 0; i < text.size(); ++i) {
    char c = text[i];
    if (c == '%') {
      const int high = i + 2 < text.size() ? HexDigit(text[i + 1]) : -1;
      const int low = i + 2 < text.size() ? HexDigit(text[i + 2]) : -1;
      if (high < 0 || low < 0) return std::nullopt;
      c = static_cast<char>(high * 16 + low);
      i += 2;
    } else if (c == '+' && plus_is_space) {
      c = ' ';
    }
    if (absl::ascii_iscntrl(static_cast<unsigned char>(c))) return std::nullopt;
    decoded += c;
  }
  // It becomes a text of a message.
  if (!IsUtf8(decoded)) return std::nullopt;
  return decoded;
}

absl::StatusOr<std::vector<UrlParameter>> ParseUrlQuery(std::string_view query) {
  std::vector<UrlParameter> parameters;
  for (const absl::string_view part :
       absl::StrSplit(absl::string_view(query.data(), query.size()), '&', absl::SkipEmpty())) {
    const size_t equals = std::min(part.find('='), part.size());
    const absl::string_view value = part.substr(std::min(equals + 1, part.size()));
    std::optional<std::string> name = DecodeUrlText({part.data(), equals}, true);
    std::optional<std::string> text = DecodeUrlText({value.data(), value.size()}, true);
    if (!name || !text) {
      return absl::InvalidArgumentError(
          absl::StrCat("the parameter '", absl::CHexEscape(std::string(part.substr(0, 80))),
                       "' of the address is not percent-encoded"));
    }
    if (std::ranges::count(parameters, *name, &UrlParameter::name) > 0) {
      return absl::InvalidArgumentError(
          absl::StrCat("the parameter '", absl::CHexEscape(*name), "' is given twice"));
    }
    if (parameters.size() >= kMaxParameters) {
      return absl::InvalidArgumentError(
          absl::StrCat("an address has at most ", kMaxParameters, " parameters"));
    }
    parameters.push_back({*std::move(name), *std::move(text)});
  }
  return parameters;
}

}  // namespace rigcal::server

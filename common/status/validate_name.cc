// SPDX-License-Identifier: Apache-2.0
#include "common/status/validate_name.h"

#include <algorithm>
#include <cstddef>
#include <string>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"

namespace rigcal {
namespace {

constexpr size_t kMaxNameLength = 64;

bool IsNameCharacter(char c) {
  return absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '-' || c == '.';
}

}  // namespace

absl::Status ValidateName(std::string_view what, std::string_view name) {
  const bool good = !name.empty() && name.size() <= kMaxNameLength && name.front() != '.' &&
                    std::all_of(name.begin(), name.end(), IsNameCharacter);
  if (good) return absl::OkStatus();
  // A name from outside may be long or hold anything; what is shown of it must not.
  const std::string_view shown = name.substr(0, kMaxNameLength);
  return absl::InvalidArgumentError(absl::StrCat(
      std::string(what), " \"", absl::CHexEscape(std::string(shown)),
      shown.size() < name.size() ? "...\"" : "\"", name.empty() ? " is empty" : " is not a name",
      ": use 1 to ", kMaxNameLength, " letters, digits, '_', '-' or '.', not beginning with '.'"));
}

}  // namespace rigcal

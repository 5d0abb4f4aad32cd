// SPDX-License-Identifier: Apache-2.0
#include "client/commands/redact.h"

#include <algorithm>
#include <cctype>
#include <cstddef>

#include "absl/strings/ascii.h"

namespace rigcal::client {
namespace {

constexpr std::string_view kRemoved = "(removed)";
constexpr std::string_view kPemBegin = "-----BEGIN ";
constexpr std::string_view kPemEnd = "-----END ";
constexpr std::string_view kSecretNames[] = {"password", "passwd",  "passphrase", "secret",
                                             "token",    "private", "credential", "api_key",
                                             "apikey",   "cookie",  "join",       "authorization"};

bool IsNameCharacter(char c) { return absl::ascii_isalnum(c) || c == '_' || c == '-' || c == '.'; }
bool IsEncoded(char c) {
  return absl::ascii_isalnum(c) || c == '_' || c == '-' || c == '+' || c == '/' || c == '=';
}

// Whole blocks, also one whose end is missing.
std::string WithoutPem(std::string_view text) {
  std::string result;
  for (;;) {
    const size_t begin = text.find(kPemBegin);
    result += text.substr(0, begin);
    if (begin == std::string_view::npos) return result;
    result += kRemoved;
    size_t end = text.find(kPemEnd, begin);
    if (end == std::string_view::npos) return result;
    end = text.find("-----", end + kPemEnd.size());
    if (end == std::string_view::npos) return result;
    text.remove_prefix(end + 5);
  }
}

// The encoded word behind each `mark`.
std::string WithoutWordsBehind(std::string_view mark, std::string_view text) {
  std::string result;
  for (;;) {
    const auto found = std::search(
        text.begin(), text.end(), mark.begin(), mark.end(),
        [](char a, char b) { return absl::ascii_tolower(a) == absl::ascii_tolower(b); });
    size_t end = static_cast<size_t>(found - text.begin());
    result += text.substr(0, end);
    if (found == text.end()) return result;
    end += mark.size();
    const size_t word = end;
    while (end < text.size() && (IsEncoded(text[end]) || text[end] == '.')) ++end;
    // The words of a sentence, such as "rk1. strings", are none.
    result += mark;
    result += end > word ? kRemoved : "";
    text.remove_prefix(end);
  }
}

// "postgres://anna:word@host" -> "postgres://(removed)@host".
std::string WithoutUrlUsers(std::string_view text) {
  std::string result;
  for (;;) {
    const size_t begin = text.find("://");
    if (begin == std::string_view::npos) return result.append(text);
    const size_t host = begin + 3;
    result += text.substr(0, host);
    text.remove_prefix(host);
    const size_t end = std::min(text.find_first_of("/ \t\r\n\"'"), text.size());
    const size_t at = text.substr(0, end).rfind('@');
    if (at == std::string_view::npos) continue;
    result += kRemoved;
    text.remove_prefix(at);
  }
}

bool IsSecretName(std::string_view name) {
  const std::string lower = absl::AsciiStrToLower(std::string(name));
  return std::ranges::any_of(kSecretNames, [&](std::string_view secret) {
    return lower.find(secret) != std::string::npos;
  });
}

size_t SkipSpaces(std::string_view text, size_t at) {
  while (at < text.size() && (text[at] == ' ' || text[at] == '\t')) ++at;
  return at;
}

// Behind the quote that closes the string which begins at `at`; npos: none does.
size_t EndOfString(std::string_view text, size_t at) {
  const char quote = text[at];
  for (size_t i = at + 1; i < text.size(); ++i) {
    if (text[i] == '\\') {
      ++i;
    } else if (text[i] == quote) {
      return i + 1;
    }
  }
  return std::string_view::npos;
}

// Behind a value: of several lines where it is one of TOML's strings of three quotes.
size_t EndOfValue(std::string_view text, size_t at) {
  const size_t line = std::min(text.find('\n', at), text.size());
  if (at >= text.size()) return at;
  for (const std::string_view quotes : {"\"\"\"", "'''"}) {
    if (text.substr(at, 3) != quotes) continue;
    const size_t end = text.find(quotes, at + 3);
    return end == std::string_view::npos ? text.size() : end + 3;
  }
  if (text[at] == '"' || text[at] == '\'') return std::min(EndOfString(text, at), text.size());
  if (text[at] == '[' || text[at] == '{') {
    const size_t end = text.find(text[at] == '[' ? ']' : '}', at);
    return end == std::string_view::npos ? text.size() : end + 1;
  }
  return line;
}

std::string WithoutSecretValues(std::string_view text) {
  std::string result;
  size_t at = 0;
  while (at < text.size()) {
    if (!IsNameCharacter(text[at])) {
      result += text[at++];
      continue;
    }
    const size_t begin = at;
    while (at < text.size() && IsNameCharacter(text[at])) ++at;
    const std::string_view name = text.substr(begin, at - begin);
    result += name;
    if (!IsSecretName(name)) continue;
    size_t sign = at;
    if (sign < text.size() && (text[sign] == '"' || text[sign] == '\'')) ++sign;
    sign = SkipSpaces(text, sign);
    if (sign >= text.size() || (text[sign] != '=' && text[sign] != ':')) continue;
    const size_t value = SkipSpaces(text, sign + 1);
    const size_t end = EndOfValue(text, value);
    result += text.substr(at, value - at);
    if (end > value) {
      const bool quoted = text[value] == '"';
      result += quoted ? "\"" : "";
      result += kRemoved;
      result += quoted ? "\"" : "";
    }
    at = std::max(end, at);
  }
  return result;
}

}  // namespace

std::string Redact(std::string_view text) {
  std::string result = WithoutPem(text);
  for (const std::string_view mark : {"rk1.", "bearer ", "basic "}) {
    result = WithoutWordsBehind(mark, result);
  }
  return WithoutSecretValues(WithoutUrlUsers(result));
}

}  // namespace rigcal::client

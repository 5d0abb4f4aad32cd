// SPDX-License-Identifier: Apache-2.0
#include "common/log/correlation_id.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <random>

namespace rigcal {
namespace {

constexpr size_t kLongest = 64;

bool IsIdCharacter(char c) {
  return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_' ||
         c == '-' || c == '.';
}

}  // namespace

std::string NewCorrelationId() {
  std::random_device random;
  char text[17];
  std::snprintf(text, sizeof(text), "%08x%08x", random(), random());
  return text;
}

bool IsCorrelationId(std::string_view text) {
  return !text.empty() && text.size() <= kLongest && std::ranges::all_of(text, IsIdCharacter);
}

const std::string& OwnCorrelationId() {
  static const std::string id = [] {
    const char* const given = std::getenv(kCorrelationVariable);
    return given != nullptr && IsCorrelationId(given) ? std::string(given) : NewCorrelationId();
  }();
  return id;
}

}  // namespace rigcal

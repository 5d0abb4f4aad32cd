// SPDX-License-Identifier: Apache-2.0
#include "common/text/shortest_text.h"

#include <charconv>

namespace rigcal {

std::string ShortestText(double value) {
  char buffer[64];
  const auto end = std::to_chars(buffer, buffer + sizeof(buffer), value);
  return std::string(buffer, end.ptr);
}

}  // namespace rigcal

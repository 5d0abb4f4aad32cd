// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <charconv>
#include <string>

namespace rigcal {

// The shortest text that reads back as the same double: "0.1", "1e-07", "inf", "nan".
inline std::string ShortestText(double value) {
  char buffer[64];
  return std::string(buffer, std::to_chars(buffer, buffer + sizeof(buffer), value).ptr);
}

}  // namespace rigcal

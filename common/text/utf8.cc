// SPDX-License-Identifier: Apache-2.0
#include "common/text/utf8.h"

#include <cstddef>
#include <cstdint>

namespace rigcal {

// Unicode 15, table 3-7: the first continuation byte has a narrower range after four lead bytes.
bool IsUtf8(std::string_view text) {
  const auto byte = [text](size_t i) -> uint8_t {
    return i < text.size() ? static_cast<uint8_t>(text[i]) : uint8_t{0};
  };
  size_t i = 0;
  while (i < text.size()) {
    const uint8_t lead = byte(i++);
    if (lead < 0x80) continue;
    if (lead < 0xC2 || lead > 0xF4) return false;
    const uint8_t lowest = lead == 0xE0 ? 0xA0 : lead == 0xF0 ? 0x90 : 0x80;
    const uint8_t highest = lead == 0xED ? 0x9F : lead == 0xF4 ? 0x8F : 0xBF;
    if (byte(i) < lowest || byte(i) > highest) return false;
    const size_t end = i + (lead < 0xE0 ? 1 : lead < 0xF0 ? 2 : 3);
    for (++i; i < end; ++i) {
      if ((byte(i) & 0xC0) != 0x80) return false;
    }
  }
  return true;
}

}  // namespace rigcal

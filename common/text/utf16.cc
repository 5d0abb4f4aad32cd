// SPDX-License-Identifier: Apache-2.0
#include "common/text/utf16.h"

#include <cstddef>

namespace rigcal {

bool BeginsLikeUtf16(std::string_view begin) {
  if (begin.starts_with("\xff\xfe") || begin.starts_with("\xfe\xff")) return true;
  constexpr size_t kLookedAt = 8;
  if (begin.size() < kLookedAt) return false;
  for (const size_t zeros_from : {size_t{0}, size_t{1}}) {
    bool fits = true;
    for (size_t i = 0; i < kLookedAt; ++i) {
      fits = fits && (begin[i] == '\0') == (i % 2 == zeros_from);
    }
    if (fits) return true;
  }
  return false;
}

}  // namespace rigcal

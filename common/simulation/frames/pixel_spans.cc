// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/pixel_spans.h"

#include <algorithm>
#include <cstddef>

namespace rigcal {

void MergeSpans(std::vector<PixelSpan>* spans) {
  std::sort(spans->begin(), spans->end(),
            [](const PixelSpan& a, const PixelSpan& b) { return a.begin < b.begin; });
  size_t count = 0;
  for (const PixelSpan& span : *spans) {
    if (span.begin >= span.end) continue;
    if (count > 0 && span.begin <= (*spans)[count - 1].end) {
      (*spans)[count - 1].end = std::max((*spans)[count - 1].end, span.end);
    } else {
      (*spans)[count++] = span;
    }
  }
  spans->resize(count);
}

void SubtractSpans(const std::vector<PixelSpan>& taken, std::vector<PixelSpan>* spans) {
  for (const PixelSpan& cut : taken) {
    for (size_t i = 0; i < spans->size(); ++i) {
      const PixelSpan span = (*spans)[i];
      if (cut.end <= span.begin || cut.begin >= span.end) continue;
      (*spans)[i].end = std::max(span.begin, cut.begin);
      if (cut.end < span.end) {
        spans->insert(spans->begin() + static_cast<std::ptrdiff_t>(i) + 1, {cut.end, span.end});
      }
    }
  }
  std::erase_if(*spans, [](const PixelSpan& span) { return span.begin >= span.end; });
}

}  // namespace rigcal

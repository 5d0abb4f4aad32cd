// SPDX-License-Identifier: Apache-2.0
#include "server/live/coverage_grid.h"

#include <algorithm>

namespace rigcal::server {
namespace {

constexpr int kEnoughCentres = 10;

}  // namespace

void CoverageGrid::Add(const ThinnedRow& row, ImageSize size) {
  if (size.width == 0 || size.height == 0) return;
  for (uint32_t m = 0; m < row.marker_count; ++m) {
    if ((row.visible_mask >> m & 1U) == 0) continue;
    const double column = (row.x_px[m] + 0.5) / size.width * kColumns;
    const double line = (row.y_px[m] + 0.5) / size.height * kRows;
    if (!(column >= 0 && column < kColumns && line >= 0 && line < kRows)) continue;
    uint8_t& cell = cells_[static_cast<size_t>(line) * kColumns + static_cast<size_t>(column)];
    if (cell < 255) ++cell;
  }
}

void CoverageGrid::Add(const CoverageGrid& other) {
  for (size_t i = 0; i < cells_.size(); ++i) {
    cells_[i] = static_cast<uint8_t>(std::min(255, cells_[i] + other.cells_[i]));
  }
}

double CoverageGrid::CoveredShare() const {
  return static_cast<double>(
             std::ranges::count_if(cells_, [](uint8_t count) { return count >= kEnoughCentres; })) /
         static_cast<double>(cells_.size());
}

}  // namespace rigcal::server

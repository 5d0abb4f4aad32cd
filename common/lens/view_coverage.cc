// SPDX-License-Identifier: Apache-2.0
#include "common/lens/view_coverage.h"

#include <algorithm>
#include <array>

#include "absl/strings/str_cat.h"

namespace rigcal {
namespace {

constexpr int kCoverageCells = 10;  // along each side

}  // namespace

double CoveredShare(const std::vector<BoardView>& views, const ImageSize& image_size_px) {
  std::array<bool, kCoverageCells* kCoverageCells> seen = {};
  for (const BoardView& view : views) {
    for (const BoardCorner& corner : view.corners) {
      const auto cell = [](double at, uint32_t size) {
        return std::clamp(static_cast<int>((at + 0.5) / size * kCoverageCells), 0,
                          kCoverageCells - 1);
      };
      seen[static_cast<size_t>(cell(corner.pixel.y(), image_size_px.height) * kCoverageCells +
                               cell(corner.pixel.x(), image_size_px.width))] = true;
    }
  }
  return static_cast<double>(std::count(seen.begin(), seen.end(), true)) /
         static_cast<double>(seen.size());
}

std::vector<std::string> BareSides(const std::vector<BoardView>& views,
                                   const ImageSize& image_size_px) {
  bool left = false, right = false, top = false, bottom = false;
  for (const BoardView& view : views) {
    for (const BoardCorner& corner : view.corners) {
      const double x = (corner.pixel.x() + 0.5) / image_size_px.width;
      const double y = (corner.pixel.y() + 0.5) / image_size_px.height;
      left = left || x < 0.2;
      right = right || x > 0.8;
      top = top || y < 0.2;
      bottom = bottom || y > 0.8;
    }
  }
  std::vector<std::string> bare;
  for (const auto& [has, side] : {std::pair(left, "left"), std::pair(right, "right"),
                                  std::pair(top, "upper"), std::pair(bottom, "lower")}) {
    if (!has) bare.push_back(absl::StrCat("no corner in the ", side, " fifth of the image"));
  }
  return bare;
}

}  // namespace rigcal

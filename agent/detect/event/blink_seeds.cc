// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/blink_seeds.h"

#include <algorithm>

namespace rigcal::agent {
namespace {

// Limits of one detection: groups of seeds, and pixels around them as a multiple of the sensor's,
// or absolute where a sensor is small.
constexpr size_t kMaxGroups = 1024;
constexpr int64_t kWorkImages = 4, kLeastWorkPx = 1 << 20;

}  // namespace

const std::vector<ComponentSums>& BlinkSeeds::Find(const BlinkPeriod& blink,
                                                   const BlinkSurface& surface) {
  Mark(blink, surface);
  return Promising(labeller_.Finish(), surface.geometry);
}

void BlinkSeeds::Mark(const BlinkPeriod& blink, const BlinkSurface& surface) {
  const uint32_t now = surface.now();
  const uint32_t width = surface.geometry.width;
  const auto words = static_cast<int>((width + 63) / 64);
  labeller_.Start(words);
  for (uint32_t tile_row = 0; tile_row < surface.tile_rows; ++tile_row) {
    const uint32_t* const tiles =
        surface.tiles + static_cast<size_t>(tile_row) * surface.tile_columns;
    // A tile's time is up to 1 late.
    const auto is_active = [&](uint32_t tile) {
      return tile != 0 && surface.time_us + 1 - tile <= recent_us_;
    };
    if (std::none_of(tiles, tiles + surface.tile_columns, is_active)) continue;
    const uint32_t y_end =
        std::min(surface.geometry.height, (tile_row + 1) << BlinkRules::kTileShift);
    for (uint32_t y = tile_row << BlinkRules::kTileShift; y < y_end; ++y) {
      const uint32_t* const row = surface.Row(static_cast<int>(y));
      words_.assign(static_cast<size_t>(words), 0);
      for (uint32_t tile = 0; tile < surface.tile_columns; ++tile) {
        if (!is_active(tiles[tile])) continue;
        const uint32_t x_end = std::min(width, (tile + 1) << BlinkRules::kTileShift);
        for (uint32_t x = tile << BlinkRules::kTileShift; x < x_end; ++x) {
          words_[x / 64] |= static_cast<uint64_t>(blink.IsSeed(row[x], now)) << (x % 64);
        }
      }
      labeller_.AddRow(static_cast<int>(y), 0, words_.data(), words);
    }
  }
}

const std::vector<ComponentSums>& BlinkSeeds::Promising(
    const std::vector<ComponentSums>& components, SensorGeometry geometry) {
  const auto window_px = [geometry](const ComponentSums& seeds) {
    const int64_t width = seeds.max_x - seeds.min_x + 1 + 2 * kReachPx;
    const int64_t height = seeds.max_y - seeds.min_y + 1 + 2 * kReachPx;
    return std::min<int64_t>(width, geometry.width) * std::min<int64_t>(height, geometry.height);
  };
  int64_t rest_px =
      std::max(kLeastWorkPx, kWorkImages * static_cast<int64_t>(geometry.width) * geometry.height);
  int64_t all_px = 0;
  largest_.clear();
  for (size_t i = 0; i < components.size(); ++i) {
    if (components[i].area < min_pixels_) continue;
    largest_.push_back(i);
    all_px += window_px(components[i]);
  }
  if (largest_.size() <= kMaxGroups && all_px <= rest_px) return components;
  std::stable_sort(largest_.begin(), largest_.end(), [&components](size_t a, size_t b) {
    return components[a].area > components[b].area;
  });
  size_t count = 0;
  while (count < std::min(largest_.size(), kMaxGroups)) {
    rest_px -= window_px(components[largest_[count]]);
    if (rest_px < 0) break;
    ++count;
  }
  largest_.resize(count);
  std::sort(largest_.begin(), largest_.end());
  promising_.clear();
  for (const size_t index : largest_) promising_.push_back(components[index]);
  return promising_;
}

}  // namespace rigcal::agent

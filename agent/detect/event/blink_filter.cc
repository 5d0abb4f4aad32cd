// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/blink_filter.h"

#include <algorithm>
#include <cmath>

#include "common/status/fault_list.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

// Sweep comes by every pixel once in so many units. A pixel just forgotten then is less than 2^16
// units old when Sweep comes again, ten periods late.
constexpr uint32_t kSweepUnits = 0x10000 - BlinkRules::kForgetUnits - (11 << 10);

// Of the unit of time, in which a period is less than 1024.
int ShiftOf(double period_us) {
  int shift = 0;
  while (period_us / (1 << shift) >= 1024) ++shift;
  return shift;
}

}  // namespace

absl::Status BlinkFilterOptions::Validate() const {
  FaultList faults;
  faults.CheckRange("width", geometry.width, 1, 2048);
  faults.CheckRange("height", geometry.height, 1, 2048);
  if (blink_hz.empty()) faults.Add("no blink frequency");
  for (const double hz : blink_hz) faults.CheckRange("blink frequency", hz, 20, 5000, " Hz");
  std::vector<double> sorted_hz = blink_hz;
  std::sort(sorted_hz.begin(), sorted_hz.end());
  for (size_t i = 1; i < sorted_hz.size(); ++i) {
    if (sorted_hz[i] >= kMinRatio * sorted_hz[i - 1]) continue;
    faults.Add("blink frequencies ", sorted_hz[i - 1], " and ", sorted_hz[i],
               " Hz are too close: the higher one must be at least ", kMinRatio,
               " times the lower, or both the same");
  }
  if (sorted_hz.size() > 1 && sorted_hz.back() > kMaxRatio * sorted_hz.front()) {
    faults.Add("blink frequencies ", sorted_hz.front(), " and ", sorted_hz.back(),
               " Hz are too far apart: at most ", kMaxRatio,
               " times, for a pixel remembers two blinks, and those of the highest would be newer "
               "than the last of the lowest");
  }
  faults.CheckRange("band", band_rel, 0.01, 0.45);
  faults.CheckRange("min_periods", min_periods, 1, 7);
  faults.CheckRange("min_blob_pixels", min_blob_pixels, 1, 100000);
  return faults.Result("blink filter: ");
}

absl::StatusOr<BlinkFilter> BlinkFilter::Create(const BlinkFilterOptions& options,
                                                const BlinkKernel& kernel) {
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  return BlinkFilter(options, kernel);
}

BlinkFilter::BlinkFilter(const BlinkFilterOptions& options, const BlinkKernel& kernel)
    : options_(options),
      period_us_(1e6 / *std::min_element(options.blink_hz.begin(), options.blink_hz.end())),
      kernel_(&kernel),
      shift_(ShiftOf(period_us_)),
      blinks_(BlinkPeriodsOf(options.blink_hz, options.band_rel, options.min_periods, shift_)),
      seeds_(static_cast<uint32_t>(2 * period_us_), options.min_blob_pixels),
      measurer_(blinks_, options.min_blob_pixels) {
  const auto [lowest_hz, highest_hz] =
      std::minmax_element(options.blink_hz.begin(), options.blink_hz.end());
  const double longest = period_us_ / (1 << shift_);
  const double shortest = longest * *lowest_hz / *highest_hz;
  // Longer, and lights of twice the frequency would have every other crossing counted.
  rules_.min_gap = 3 * static_cast<uint32_t>(std::lround(shortest)) / 10;
  // The ON events of one burst come within half a period. Of the shortest: else the front of a fast
  // blinking marker that moves, lit late and in reset when the light goes out, would be missed in
  // the next burst. Two ON so far apart in a slower marker's burst are rare, and cost a pixel.
  rules_.again_gap = 11 * static_cast<uint32_t>(std::lround(shortest)) / 20 - rules_.min_gap;
  rules_.low_gap = static_cast<uint32_t>(std::lround(shortest * (1 - options.band_rel)));
  rules_.band_gap =
      static_cast<uint32_t>(std::lround(longest * (1 + options.band_rel))) - rules_.low_gap;
  rules_.shift = shift_;
  rules_.stride = options.geometry.width;
  rules_.tile_columns = (options.geometry.width + (1u << kTileShift) - 1) >> kTileShift;
  rules_.min_periods = static_cast<uint32_t>(options.min_periods);
  tile_rows_ = (options.geometry.height + (1u << kTileShift) - 1) >> kTileShift;
  states_.assign(static_cast<size_t>(rules_.stride) * options.geometry.height, 0);
  tiles_.assign(static_cast<size_t>(rules_.tile_columns) * tile_rows_, 0);
}

void BlinkFilter::LookFor(PixelAnswers answers) {
  constexpr uint32_t kPolarity = 1u << 31;
  rules_.flip = answers == PixelAnswers::kFall ? kPolarity : 0;
  rules_.needs_off = answers == PixelAnswers::kBoth ? kPolarity : 0;
}

void BlinkFilter::TimeStepBack(int64_t time_us) {
  // As long ago as pixels that Sweep has forgotten.
  const uint32_t now = static_cast<uint32_t>(time_us) >> shift_;
  std::fill(states_.begin(), states_.end(), (now - BlinkRules::kForgetUnits) << 16);
  std::fill(tiles_.begin(), tiles_.end(), 0);
  // There is nothing to forget.
  swept_us_ = static_cast<uint32_t>(time_us);
  sweep_from_ = 0;
  has_swept_ = true;
}

void BlinkFilter::Sweep(uint32_t time_us) {
  const uint64_t since_us = time_us - swept_us_;
  const uint64_t round_us = uint64_t{kSweepUnits} << shift_;
  size_t count = states_.size();
  if (has_swept_ && since_us < round_us) count = (count * since_us + round_us - 1) / round_us;
  const uint32_t now = time_us >> shift_;
  const size_t first = std::min(count, states_.size() - sweep_from_);
  kernel_->sweep(now, states_.data() + sweep_from_, first);
  kernel_->sweep(now, states_.data(), count - first);
  sweep_from_ = first < count ? count - first : sweep_from_ + first;
  swept_us_ = time_us;
  has_swept_ = true;
}

void BlinkFilter::MarkActive(uint32_t time_us, std::vector<uint8_t>* tiles) const {
  tiles->assign(tiles_.size(), 0);
  const auto recent_us = static_cast<uint32_t>(2 * period_us_);
  const auto columns = static_cast<int>(rules_.tile_columns), rows = static_cast<int>(tile_rows_);
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x) {
      const uint32_t blinked_us = tiles_[static_cast<size_t>(y * columns + x)];
      if (blinked_us == 0 || time_us + 1 - blinked_us > recent_us) continue;
      for (int v = std::max(0, y - 1); v <= std::min(rows - 1, y + 1); ++v) {
        for (int u = std::max(0, x - 1); u <= std::min(columns - 1, x + 1); ++u) {
          (*tiles)[static_cast<size_t>(v * columns + u)] = 1;
        }
      }
    }
  }
}

const std::vector<BlinkBlob>& BlinkFilter::FindBlobs(uint32_t time_us) {
  blobs_.clear();
  const BlinkSurface surface = {.geometry = options_.geometry,
                                .states = states_.data(),
                                .tiles = tiles_.data(),
                                .tile_columns = rules_.tile_columns,
                                .tile_rows = tile_rows_,
                                .time_us = time_us,
                                .shift = shift_};
  for (const BlinkPeriod& blink : blinks_) {
    for (const ComponentSums& seeds : seeds_.Find(blink, surface)) {
      if (seeds.area < options_.min_blob_pixels) continue;
      measurer_.Measure(blink, seeds, surface, &blobs_);
    }
  }
  return blobs_;
}

}  // namespace rigcal::agent

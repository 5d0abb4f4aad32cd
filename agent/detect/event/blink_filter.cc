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

// Of a period: so much before a gap begins pixels may still have to answer.
constexpr uint32_t kBridgeMarginDivisor = 16;

// Pixels of a tile that blink and miss blinks: noise is a pixel or two. Of a period: by which their
// answers may be away from a whole number of periods.
constexpr int kMissPixels = 12;
constexpr uint32_t kMissToleranceDivisor = 10;

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

std::optional<double> BlinkFilter::AnsweredShare(uint32_t time_us) const {
  const uint32_t now = time_us >> shift_, period = blinks_.front().period;
  const uint32_t tolerance = period / kMissToleranceDivisor;
  int once = 0, twice = 0, more = 0;  // pixels whose last two answers are so many periods apart
  for (uint32_t tile = 0; tile < tiles_.size(); ++tile) {
    const uint32_t x0 = tile % rules_.tile_columns << kTileShift;
    const uint32_t y0 = tile / rules_.tile_columns << kTileShift;
    const uint32_t x1 = std::min(options_.geometry.width, x0 + (1u << kTileShift));
    const uint32_t y1 = std::min(options_.geometry.height, y0 + (1u << kTileShift));
    int count[4] = {};
    for (uint32_t y = y0; y < y1; ++y) {
      const uint32_t* const row = states_.data() + static_cast<size_t>(y) * rules_.stride;
      for (uint32_t x = x0; x < x1; ++x) {
        const uint32_t gap = row[x] >> 4 & BlinkRules::kMaxGap;
        const uint32_t periods = (gap + period / 2) / period;
        if (periods < 1 || periods > 3 || ((now - (row[x] >> 16)) & 0xffff) > 4 * period) continue;
        if (gap - periods * period + tolerance <= 2 * tolerance) ++count[periods];
      }
    }
    // Of lights of half or a third of the frequency no two answers are one period apart.
    const int missing = count[2] + count[3];
    if (count[1] + missing < kMissPixels || 4 * missing < count[1] || count[1] * 4 < missing) {
      continue;
    }
    once += count[1], twice += count[2], more += count[3];
  }
  if (once + twice + more == 0) return std::nullopt;
  // Blinks that are missed by chance: of n periods to the next answer each is as much rarer than n
  // - 1 as blinks are missed.
  return std::max(0.0, 1 - static_cast<double>(twice + more) / (once + twice));
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

void BlinkFilter::Bridge(uint32_t from_us, uint32_t until_us) {
  const uint32_t from = from_us >> shift_, length = (until_us - from_us) >> shift_;
  const auto nominal = static_cast<uint32_t>(std::lround(period_us_ / (1 << shift_)));
  const uint32_t margin = nominal / kBridgeMarginDivisor;
  const auto recent_us = static_cast<uint32_t>(2 * period_us_) + until_us - from_us;
  for (uint32_t tile = 0; tile < tiles_.size(); ++tile) {
    if (tiles_[tile] == 0 || until_us + 1 - tiles_[tile] > recent_us) continue;
    const uint32_t x0 = tile % rules_.tile_columns << kTileShift;
    const uint32_t y0 = tile / rules_.tile_columns << kTileShift;
    const uint32_t x1 = std::min(options_.geometry.width, x0 + (1u << kTileShift));
    const uint32_t y1 = std::min(options_.geometry.height, y0 + (1u << kTileShift));
    bool has_lit = false;
    for (uint32_t y = y0; y < y1; ++y) {
      uint32_t* const row = states_.data() + static_cast<size_t>(y) * rules_.stride;
      for (uint32_t x = x0; x < x1; ++x) has_lit |= Bridge(from - margin, length + margin, &row[x]);
    }
    // A tile's time is 1 late at most.
    if (has_lit) tiles_[tile] = (until_us - 1) | 1;
  }
}

bool BlinkFilter::Bridge(uint32_t from, uint32_t length, uint32_t* state) const {
  const uint32_t gap = *state >> 4 & BlinkRules::kMaxGap;
  const bool is_in_band = gap - rules_.low_gap <= rules_.band_gap;
  if (!is_in_band && blinks_.size() > 1) return false;  // of which light is not known
  const uint32_t period = is_in_band ? gap : blinks_.front().period;
  // From the last crossing to the gap; negative: bridged up to there already.
  const int32_t since = static_cast<int16_t>(from - (*state >> 16));
  const int32_t elapsed = since + static_cast<int32_t>(length);
  if (since > static_cast<int32_t>(period) || elapsed < 0) return false;
  // What it missed: falls at least.
  if (rules_.needs_off != 0) *state &= ~BlinkRules::kOnBit;
  const uint32_t missed = static_cast<uint32_t>(elapsed) / period;
  if (missed == 0) return false;
  const uint32_t last = ((*state >> 16) + missed * period) & 0xffff;
  *state = last << 16 | period << 4 | (*state & 0xf);
  return true;
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

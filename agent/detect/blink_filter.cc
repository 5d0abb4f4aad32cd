// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blink_filter.h"

#include <algorithm>
#include <climits>
#include <cmath>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

// A pixel that has been silent for so long is as one that never spoke.
constexpr uint32_t kForgetUnits = 0x8000;
// Of a period: pixels light up around the burst's middle by at most this much (latency, readout).
constexpr double kJitterShare = 0.12;
// Ratio of second moments that one marker does not have: a disc that moves by its radius has 1.3.
constexpr double kLongRatio = 1.6;

bool IsLong(const PixelList& pixels) {
  double sx = 0, sy = 0, sxx = 0, sxy = 0, syy = 0;
  for (const auto& [x, y] : pixels) {
    const double dx = x - pixels.front().first, dy = y - pixels.front().second;
    sx += dx, sy += dy, sxx += dx * dx, sxy += dx * dy, syy += dy * dy;
  }
  const auto count = static_cast<double>(pixels.size());
  const double xx = sxx - sx * sx / count, xy = sxy - sx * sy / count, yy = syy - sy * sy / count;
  const double mean = 0.5 * (xx + yy), apart = std::hypot(0.5 * (xx - yy), xy);
  return mean + apart > kLongRatio * (mean - apart);
}

}  // namespace

absl::Status BlinkFilterOptions::Validate() const {
  std::vector<std::string> faults;
  const auto check = [&faults](const char* name, double value, double low, double high) {
    if (value >= low && value <= high) return;
    faults.push_back(absl::StrCat(name, " is ", value, ", but must be ", low, " to ", high));
  };
  check("width", geometry.width, 1, 2048);
  check("height", geometry.height, 1, 2048);
  check("blink frequency (Hz)", blink_hz, 20, 5000);
  check("band", band_rel, 0.01, 0.45);
  check("min_periods", min_periods, 1, 7);
  check("min_blob_pixels", min_blob_pixels, 1, 100000);
  check("reach", reach_px, 1, 200);
  if (faults.empty()) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("blink filter: ", absl::StrJoin(faults, "; ")));
}

absl::StatusOr<BlinkFilter> BlinkFilter::Create(const BlinkFilterOptions& options) {
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  return BlinkFilter(options);
}

BlinkFilter::BlinkFilter(const BlinkFilterOptions& options)
    : options_(options), period_us_(1e6 / options.blink_hz), shift_(0) {
  while (period_us_ / (1 << shift_) >= 1024) ++shift_;
  const double units = period_us_ / (1 << shift_);
  period_units_ = static_cast<uint32_t>(std::lround(units));
  // Longer, and lights of twice the frequency would have every other crossing counted.
  min_gap_ = 3 * period_units_ / 10;
  // The ON events of one burst come within half a period.
  again_gap_ = 11 * period_units_ / 20;
  low_gap_ = static_cast<uint32_t>(std::lround(units * (1 - options.band_rel)));
  band_gap_ = static_cast<uint32_t>(std::lround(units * (1 + options.band_rel))) - low_gap_;
  min_periods_ = static_cast<uint32_t>(options.min_periods);
  lit_units_ = period_units_ / 2;
  stride_ = options.geometry.width;
  tile_columns_ = (options.geometry.width + (1u << kTileShift) - 1) >> kTileShift;
  tile_rows_ = (options.geometry.height + (1u << kTileShift) - 1) >> kTileShift;
  states_.assign(static_cast<size_t>(stride_) * options.geometry.height, 0);
  tiles_.assign(static_cast<size_t>(tile_columns_) * tile_rows_, 0);
}

void BlinkFilter::TimeStepBack(int64_t) {
  std::fill(states_.begin(), states_.end(), 0);
  std::fill(tiles_.begin(), tiles_.end(), 0);
}

void BlinkFilter::Sweep(uint32_t time_us) {
  const uint32_t now = time_us >> shift_;
  const uint32_t forgotten = (now - kForgetUnits) << 16;
  for (uint32_t& state : states_) {
    const uint32_t gap = (now - (state >> 16)) & 0xffff;
    state = gap >= kForgetUnits ? forgotten | (state & kOnBit) : state;
  }
}

bool BlinkFilter::IsSeed(uint32_t state, uint32_t now) const {
  const uint32_t gap = (now - (state >> 16)) & 0xffff;
  return (state & kPeriodsMask) >= min_periods_ && gap < period_units_ + lit_units_;
}

int BlinkFilter::UnitsSinceBurst(uint32_t state, uint32_t now) const {
  const uint32_t last = (now - (state >> 16)) & 0xffff;
  if (last >= lit_units_) return static_cast<int>(last);
  const uint32_t gap = state >> 4 & kMaxGap;
  return gap == kMaxGap ? -1 : static_cast<int>(last + gap);
}

bool BlinkFilter::LitUpBetween(uint32_t state, uint32_t now, uint32_t newest,
                               uint32_t oldest) const {
  const uint32_t last = (now - (state >> 16)) & 0xffff;
  const uint32_t gap = state >> 4 & kMaxGap;
  return last - newest <= oldest - newest ||
         (gap != kMaxGap && last + gap - newest <= oldest - newest);
}

BlinkFilter::Burst BlinkFilter::FindBurst(const ComponentSums& seeds, uint32_t now) {
  ages_.clear();
  double gaps = 0;
  for (int y = seeds.min_y; y <= seeds.max_y; ++y) {
    const uint32_t* const row = states_.data() + static_cast<size_t>(y) * stride_;
    for (int x = seeds.min_x; x <= seeds.max_x; ++x) {
      if (!IsSeed(row[x], now)) continue;
      ages_.push_back(UnitsSinceBurst(row[x], now));
      gaps += row[x] >> 4 & kMaxGap;
    }
  }
  Burst burst;
  if (ages_.empty()) return burst;
  burst.period_us = gaps / static_cast<double>(ages_.size()) * (1 << shift_);
  // Pixels whose burst is just over and those whose next one has begun are a period apart: the
  // newest burst that most pixels took part in.
  const auto middle = ages_.begin() + static_cast<std::ptrdiff_t>(ages_.size() / 2);
  std::nth_element(ages_.begin(), middle, ages_.end());
  burst.start_units = *middle;
  burst.found = *middle >= 0;
  return burst;
}

void BlinkFilter::Measure(const ComponentSums& seeds, const Burst& burst, uint32_t time_us) {
  const double jitter = kJitterShare * period_units_;
  const auto oldest = static_cast<uint32_t>(std::lround(burst.start_units + jitter));
  const auto newest =
      static_cast<uint32_t>(std::max(0L, std::lround(burst.start_units - lit_units_)));
  Grow(seeds, time_us >> shift_, newest, oldest);
  if (static_cast<int>(lit_.size()) < options_.min_blob_pixels) return;
  if (!IsLong(lit_)) return AddBlob(lit_, burst, time_us);
  for (const PixelList& part : splitter_.Split(lit_, options_.min_blob_pixels)) {
    AddBlob(part, burst, time_us);
  }
}

void BlinkFilter::AddBlob(const PixelList& pixels, const Burst& burst, uint32_t time_us) {
  double sx = 0, sy = 0, sxx = 0, sxy = 0, syy = 0;
  int min_x = INT_MAX, max_x = -1, min_y = INT_MAX, max_y = -1;
  const auto [x0, y0] = pixels.front();
  for (const auto& [x, y] : pixels) {
    const double dx = x - x0, dy = y - y0;
    sx += dx, sy += dy;
    sxx += dx * dx, sxy += dx * dy, syy += dy * dy;
    min_x = std::min(min_x, x), max_x = std::max(max_x, x);
    min_y = std::min(min_y, y), max_y = std::max(max_y, y);
  }
  const auto count = static_cast<double>(pixels.size());
  const double mx = sx / count, my = sy / count;
  const double unit_us = 1 << shift_;
  BlinkBlob blob;
  blob.centre_px = {x0 + mx, y0 + my};
  blob.second_moment_px2 << sxx / count - mx * mx, sxy / count - mx * my, sxy / count - mx * my,
      syy / count - my * my;
  blob.area_px = static_cast<int>(count);
  blob.time_us = unit_us * (static_cast<double>(time_us >> shift_) - burst.start_units +
                            0.5 * static_cast<double>(lit_units_));
  blob.period_us = burst.period_us;
  blob.box = {min_x, min_y, max_x - min_x + 1, max_y - min_y + 1};
  blob.touches_border = min_x == 0 || min_y == 0 ||
                        max_x + 1 == static_cast<int>(options_.geometry.width) ||
                        max_y + 1 == static_cast<int>(options_.geometry.height);
  // Markers that have grown together are found from the seeds of each.
  for (const BlinkBlob& other : blobs_) {
    if ((other.centre_px - blob.centre_px).squaredNorm() < 4) return;
  }
  blobs_.push_back(blob);
}

void BlinkFilter::Grow(const ComponentSums& seeds, uint32_t now, uint32_t newest, uint32_t oldest) {
  const int reach = options_.reach_px;
  const int x_begin = std::max(0, seeds.min_x - reach);
  const int y_begin = std::max(0, seeds.min_y - reach);
  const int x_end = std::min(static_cast<int>(options_.geometry.width), seeds.max_x + 1 + reach);
  const int y_end = std::min(static_cast<int>(options_.geometry.height), seeds.max_y + 1 + reach);
  const int width = x_end - x_begin;
  lit_.clear();
  seen_.assign(static_cast<size_t>(width) * static_cast<size_t>(y_end - y_begin), 0);
  const auto visit = [&](int x, int y) {
    uint8_t& seen = seen_[static_cast<size_t>((y - y_begin) * width + x - x_begin)];
    if (seen != 0) return;
    seen = 1;
    const size_t pixel = static_cast<size_t>(y) * stride_ + static_cast<size_t>(x);
    if (LitUpBetween(states_[pixel], now, newest, oldest)) lit_.emplace_back(x, y);
  };
  for (int y = seeds.min_y; y <= seeds.max_y; ++y) {
    for (int x = seeds.min_x; x <= seeds.max_x; ++x) {
      if (IsSeed(states_[static_cast<size_t>(y) * stride_ + static_cast<size_t>(x)], now)) {
        visit(x, y);
      }
    }
  }
  for (size_t next = 0; next < lit_.size(); ++next) {
    const auto [x, y] = lit_[next];
    for (int v = std::max(y_begin, y - 1); v <= std::min(y_end - 1, y + 1); ++v) {
      for (int u = std::max(x_begin, x - 1); u <= std::min(x_end - 1, x + 1); ++u) visit(u, v);
    }
  }
}

void BlinkFilter::MarkSeeds(uint32_t time_us) {
  const uint32_t now = time_us >> shift_;
  const auto recent_us = static_cast<uint32_t>(2 * period_us_);
  const auto words = static_cast<int>((stride_ + 63) / 64);
  labeller_.Start(words);
  for (uint32_t tile_row = 0; tile_row < tile_rows_; ++tile_row) {
    const uint32_t* const tiles = tiles_.data() + static_cast<size_t>(tile_row) * tile_columns_;
    const auto is_active = [&](uint32_t tile) { return tile != 0 && time_us - tile <= recent_us; };
    if (std::none_of(tiles, tiles + tile_columns_, is_active)) continue;
    const uint32_t y_end = std::min(options_.geometry.height, (tile_row + 1) << kTileShift);
    for (uint32_t y = tile_row << kTileShift; y < y_end; ++y) {
      const uint32_t* const row = states_.data() + static_cast<size_t>(y) * stride_;
      seed_words_.assign(static_cast<size_t>(words), 0);
      for (uint32_t tile = 0; tile < tile_columns_; ++tile) {
        if (!is_active(tiles[tile])) continue;
        const uint32_t x_end = std::min(stride_, (tile + 1) << kTileShift);
        for (uint32_t x = tile << kTileShift; x < x_end; ++x) {
          seed_words_[x / 64] |= static_cast<uint64_t>(IsSeed(row[x], now)) << (x % 64);
        }
      }
      labeller_.AddRow(static_cast<int>(y), 0, seed_words_.data(), words);
    }
  }
}

const std::vector<BlinkBlob>& BlinkFilter::FindBlobs(uint32_t time_us) {
  blobs_.clear();
  MarkSeeds(time_us);
  for (const ComponentSums& seeds : labeller_.Finish()) {
    if (seeds.area < options_.min_blob_pixels) continue;
    const Burst burst = FindBurst(seeds, time_us >> shift_);
    if (burst.found) Measure(seeds, burst, time_us);
  }
  return blobs_;
}

}  // namespace rigcal::agent

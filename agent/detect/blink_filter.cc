// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blink_filter.h"

#include <algorithm>
#include <climits>
#include <cmath>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "agent/detect/burst_shape.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

// Sweep comes by every pixel once in so many units. A pixel just forgotten then is less than 2^16
// units old when Sweep comes again, ten periods late.
constexpr uint32_t kSweepUnits = 0x10000 - BlinkRules::kForgetUnits - (11 << 10);
// Of a period: pixels light up around the burst's middle by at most this much (latency, readout).
constexpr double kJitterShare = 0.12;
// Groups of seeds that are looked at for one answer, and pixels around them: so many images, or
// this many where an image is small.
constexpr size_t kMaxGroups = 1024;
constexpr int64_t kWorkImages = 4, kLeastWorkPx = 1 << 20;
// Of the way to the next frequency: what lies within it is a marker's.
constexpr double kOwnShare = 0.4;
// Of the time by which a period is shorter than the longest: so much longer ago its burst is looked
// for, which is near the middle of the time within which that of the longest lies.
constexpr double kLookBack = 0.8;
// Pixels that Grow has come to, and those of them that lit up.
constexpr uint8_t kSeen = 1, kLit = 2;
// Of a pixel's eight neighbours: a lit one with fewer beside it is noise that hangs on; an unlit
// one with more is a pixel that noise had put in reset.
constexpr int kMinBeside = 3, kHoleBeside = 6;

}  // namespace

absl::Status BlinkFilterOptions::Validate() const {
  std::vector<std::string> faults;
  const auto check = [&faults](const char* name, double value, double low, double high) {
    if (value >= low && value <= high) return;
    faults.push_back(absl::StrCat(name, " is ", value, ", but must be ", low, " to ", high));
  };
  check("width", geometry.width, 1, 2048);
  check("height", geometry.height, 1, 2048);
  if (blink_hz.empty()) faults.emplace_back("no blink frequency");
  for (const double hz : blink_hz) check("blink frequency (Hz)", hz, 20, 5000);
  std::vector<double> sorted_hz = blink_hz;
  std::sort(sorted_hz.begin(), sorted_hz.end());
  for (size_t i = 1; i < sorted_hz.size(); ++i) {
    if (sorted_hz[i] >= kMinRatio * sorted_hz[i - 1]) continue;
    faults.push_back(absl::StrCat("blink frequencies ", sorted_hz[i - 1], " and ", sorted_hz[i],
                                  " Hz are too near to be told apart: the higher one must be at "
                                  "least ",
                                  kMinRatio, " times the lower, or both the same"));
  }
  if (sorted_hz.size() > 1 && sorted_hz.back() > kMaxRatio * sorted_hz.front()) {
    faults.push_back(absl::StrCat("blink frequencies ", sorted_hz.front(), " and ",
                                  sorted_hz.back(), " Hz are too far apart: at most ", kMaxRatio,
                                  " times, for a pixel remembers two blinks, and those of the "
                                  "highest would be newer than the last of the lowest"));
  }
  check("band", band_rel, 0.01, 0.45);
  check("min_periods", min_periods, 1, 7);
  check("min_blob_pixels", min_blob_pixels, 1, 100000);
  check("reach", reach_px, 1, 200);
  if (faults.empty()) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("blink filter: ", absl::StrJoin(faults, "; ")));
}

absl::StatusOr<BlinkFilter> BlinkFilter::Create(const BlinkFilterOptions& options,
                                                const BlinkKernel& kernel) {
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  return BlinkFilter(options, kernel);
}

BlinkFilter::BlinkFilter(const BlinkFilterOptions& options, const BlinkKernel& kernel)
    : options_(options), kernel_(&kernel), shift_(0) {
  const auto [lowest_hz, highest_hz] =
      std::minmax_element(options.blink_hz.begin(), options.blink_hz.end());
  period_us_ = 1e6 / *lowest_hz;
  while (period_us_ / (1 << shift_) >= 1024) ++shift_;
  AddBlinks();
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
  min_periods_ = static_cast<uint32_t>(options.min_periods);
  stride_ = options.geometry.width;
  tile_columns_ = (options.geometry.width + (1u << kTileShift) - 1) >> kTileShift;
  tile_rows_ = (options.geometry.height + (1u << kTileShift) - 1) >> kTileShift;
  rules_.shift = shift_;
  rules_.stride = stride_;
  rules_.tile_columns = tile_columns_;
  rules_.min_periods = min_periods_;
  states_.assign(static_cast<size_t>(stride_) * options.geometry.height, 0);
  tiles_.assign(static_cast<size_t>(tile_columns_) * tile_rows_, 0);
}

void BlinkFilter::AddBlinks() {
  const double longest = period_us_ / (1 << shift_);
  for (const double hz : options_.blink_hz) {
    Blink blink;
    blink.index = static_cast<int>(blinks_.size());
    blink.period_us = 1e6 / hz;
    blink.band_rel = options_.band_rel;
    const double units = blink.period_us / (1 << shift_);
    double shortest = 0, past_longest = kMaxGap;
    for (const double other_hz : options_.blink_hz) {
      if (other_hz == hz) continue;
      const double ratio = std::max(hz / other_hz, other_hz / hz);
      blink.band_rel = std::min(blink.band_rel, kOwnShare * (1 - 1 / ratio));
      if (other_hz > hz) shortest = std::max(shortest, units / std::sqrt(ratio));
      if (other_hz < hz) past_longest = std::min(past_longest, units * std::sqrt(ratio));
    }
    blink.shortest = static_cast<uint32_t>(std::lround(shortest));
    blink.longest = static_cast<uint32_t>(std::lround(past_longest)) - 1;
    blink.period = static_cast<uint32_t>(std::lround(units));
    blink.lit = blink.period / 2;
    blink.over = blink.lit + static_cast<uint32_t>(std::lround(kLookBack * (longest - units)));
    blinks_.push_back(blink);
  }
}

void BlinkFilter::TimeStepBack(int64_t time_us) {
  std::fill(states_.begin(), states_.end(), 0);
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

bool BlinkFilter::IsSeed(const Blink& blink, uint32_t state, uint32_t now) const {
  const uint32_t since = (now - (state >> 16)) & 0xffff;
  const uint32_t gap = state >> 4 & kMaxGap;
  return (state & kPeriodsMask) >= min_periods_ && since < blink.period + blink.over &&
         gap - blink.shortest <= blink.longest - blink.shortest;
}

bool BlinkFilter::IsSeedOfAnother(const Blink& blink, uint32_t state, uint32_t now) const {
  return std::any_of(blinks_.begin(), blinks_.end(), [&](const Blink& other) {
    return other.index != blink.index && IsSeed(other, state, now);
  });
}

int BlinkFilter::UnitsSinceBurst(const Blink& blink, uint32_t state, uint32_t now) const {
  const uint32_t last = (now - (state >> 16)) & 0xffff;
  if (last >= blink.over) return static_cast<int>(last);
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

BlinkFilter::Burst BlinkFilter::FindBurst(const Blink& blink, const ComponentSums& seeds,
                                          uint32_t now) {
  ages_.clear();
  double gaps = 0;
  for (int y = seeds.min_y; y <= seeds.max_y; ++y) {
    const uint32_t* const row = states_.data() + static_cast<size_t>(y) * stride_;
    for (int x = seeds.min_x; x <= seeds.max_x; ++x) {
      if (!IsSeed(blink, row[x], now)) continue;
      ages_.push_back(UnitsSinceBurst(blink, row[x], now));
      gaps += row[x] >> 4 & kMaxGap;
    }
  }
  Burst burst;
  if (ages_.empty()) return burst;
  burst.period_us = gaps / static_cast<double>(ages_.size()) * (1 << shift_);
  if (std::abs(burst.period_us / blink.period_us - 1) > blink.band_rel) return burst;
  // Pixels whose burst is just over and those whose next one has begun are a period apart: the
  // newest burst that most pixels took part in.
  const auto middle = ages_.begin() + static_cast<std::ptrdiff_t>(ages_.size() / 2);
  std::nth_element(ages_.begin(), middle, ages_.end());
  burst.start_units = *middle;
  burst.found = *middle >= 0;
  return burst;
}

void BlinkFilter::Measure(const Blink& blink, const ComponentSums& seeds, const Burst& burst,
                          uint32_t time_us) {
  const double jitter = kJitterShare * blink.period;
  const auto oldest = static_cast<uint32_t>(std::lround(burst.start_units + jitter));
  const auto newest =
      static_cast<uint32_t>(std::max(0L, std::lround(burst.start_units - blink.lit)));
  Grow(blink, seeds, time_us >> shift_, newest, oldest);
  Smooth();
  if (static_cast<int>(lit_.size()) < options_.min_blob_pixels) return;
  if (!ShapeOf(lit_).IsLong()) return AddBlob(blink, &lit_, burst, time_us);
  for (PixelList part : splitter_.Split(lit_, options_.min_blob_pixels)) {
    AddBlob(blink, &part, burst, time_us);
  }
}

void BlinkFilter::AddBlob(const Blink& blink, PixelList* pixels, const Burst& burst,
                          uint32_t time_us) {
  const BurstShape shape = MarkerShapeOf(pixels);
  int min_x = INT_MAX, max_x = -1, min_y = INT_MAX, max_y = -1;
  for (const auto& [x, y] : *pixels) {
    min_x = std::min(min_x, x), max_x = std::max(max_x, x);
    min_y = std::min(min_y, y), max_y = std::max(max_y, y);
  }
  const double unit_us = 1 << shift_;
  BlinkBlob blob;
  blob.centre_px = shape.centre_px;
  blob.second_moment_px2 = shape.second_moment_px2;
  blob.area_px = shape.area_px;
  blob.time_us = unit_us * (static_cast<double>(time_us >> shift_) - burst.start_units +
                            0.5 * static_cast<double>(blink.lit));
  blob.period_us = burst.period_us;
  blob.frequency = blink.index;
  blob.box = {min_x, min_y, max_x - min_x + 1, max_y - min_y + 1};
  blob.touches_border = min_x == 0 || min_y == 0 ||
                        max_x + 1 == static_cast<int>(options_.geometry.width) ||
                        max_y + 1 == static_cast<int>(options_.geometry.height);
  // Markers that have grown together are found from the seeds of each.
  for (const BlinkBlob& other : blobs_) {
    if (other.frequency == blob.frequency && (other.centre_px - blob.centre_px).squaredNorm() < 4)
      return;
  }
  blobs_.push_back(blob);
}

void BlinkFilter::Grow(const Blink& blink, const ComponentSums& seeds, uint32_t now,
                       uint32_t newest, uint32_t oldest) {
  const int reach = options_.reach_px;
  const int x_begin = std::max(0, seeds.min_x - reach);
  const int y_begin = std::max(0, seeds.min_y - reach);
  const int x_end = std::min(static_cast<int>(options_.geometry.width), seeds.max_x + 1 + reach);
  const int y_end = std::min(static_cast<int>(options_.geometry.height), seeds.max_y + 1 + reach);
  const int width = x_end - x_begin;
  window_ = {x_begin, y_begin, width, y_end - y_begin};
  lit_.clear();
  seen_.assign(static_cast<size_t>(width) * static_cast<size_t>(y_end - y_begin), 0);
  const auto visit = [&](int x, int y) {
    uint8_t& seen = seen_[static_cast<size_t>((y - y_begin) * width + x - x_begin)];
    if (seen != 0) return;
    seen = kSeen;
    const size_t pixel = static_cast<size_t>(y) * stride_ + static_cast<size_t>(x);
    if (!LitUpBetween(states_[pixel], now, newest, oldest)) return;
    // Of a marker beside this one.
    if (blinks_.size() > 1 && IsSeedOfAnother(blink, states_[pixel], now)) return;
    seen = kLit;
    lit_.emplace_back(x, y);
  };
  for (int y = seeds.min_y; y <= seeds.max_y; ++y) {
    for (int x = seeds.min_x; x <= seeds.max_x; ++x) {
      if (IsSeed(blink, states_[static_cast<size_t>(y) * stride_ + static_cast<size_t>(x)], now)) {
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

void BlinkFilter::Smooth() {
  const auto lit = [this](int x, int y) {
    const int u = x - window_.x, v = y - window_.y;
    if (u < 0 || v < 0 || u >= window_.width || v >= window_.height) return 0;
    return seen_[static_cast<size_t>(v * window_.width + u)] == kLit ? 1 : 0;
  };
  const auto lit_beside = [&lit](int x, int y) {
    int count = -lit(x, y);
    for (int v = y - 1; v <= y + 1; ++v) {
      for (int u = x - 1; u <= x + 1; ++u) count += lit(u, v);
    }
    return count;
  };
  smoothed_.clear();
  int min_x = INT_MAX, max_x = -1, min_y = INT_MAX, max_y = -1;
  for (const auto& [x, y] : lit_) {
    if (lit_beside(x, y) >= kMinBeside) smoothed_.emplace_back(x, y);
    min_x = std::min(min_x, x), max_x = std::max(max_x, x);
    min_y = std::min(min_y, y), max_y = std::max(max_y, y);
  }
  for (int y = min_y; y <= max_y; ++y) {
    for (int x = min_x; x <= max_x; ++x) {
      if (lit(x, y) == 0 && lit_beside(x, y) >= kHoleBeside) smoothed_.emplace_back(x, y);
    }
  }
  std::swap(lit_, smoothed_);
}

void BlinkFilter::MarkSeeds(const Blink& blink, uint32_t time_us) {
  const uint32_t now = time_us >> shift_;
  const auto recent_us = static_cast<uint32_t>(2 * period_us_);
  const auto words = static_cast<int>((stride_ + 63) / 64);
  labeller_.Start(words);
  for (uint32_t tile_row = 0; tile_row < tile_rows_; ++tile_row) {
    const uint32_t* const tiles = tiles_.data() + static_cast<size_t>(tile_row) * tile_columns_;
    // A tile's time is up to 1 late.
    const auto is_active = [&](uint32_t tile) {
      return tile != 0 && time_us + 1 - tile <= recent_us;
    };
    if (std::none_of(tiles, tiles + tile_columns_, is_active)) continue;
    const uint32_t y_end = std::min(options_.geometry.height, (tile_row + 1) << kTileShift);
    for (uint32_t y = tile_row << kTileShift; y < y_end; ++y) {
      const uint32_t* const row = states_.data() + static_cast<size_t>(y) * stride_;
      seed_words_.assign(static_cast<size_t>(words), 0);
      for (uint32_t tile = 0; tile < tile_columns_; ++tile) {
        if (!is_active(tiles[tile])) continue;
        const uint32_t x_end = std::min(stride_, (tile + 1) << kTileShift);
        for (uint32_t x = tile << kTileShift; x < x_end; ++x) {
          seed_words_[x / 64] |= static_cast<uint64_t>(IsSeed(blink, row[x], now)) << (x % 64);
        }
      }
      labeller_.AddRow(static_cast<int>(y), 0, seed_words_.data(), words);
    }
  }
}

const std::vector<ComponentSums>& BlinkFilter::Promising(
    const std::vector<ComponentSums>& components) {
  const auto window_px = [this](const ComponentSums& seeds) {
    const int64_t width = seeds.max_x - seeds.min_x + 1 + 2 * options_.reach_px;
    const int64_t height = seeds.max_y - seeds.min_y + 1 + 2 * options_.reach_px;
    return std::min<int64_t>(width, options_.geometry.width) *
           std::min<int64_t>(height, options_.geometry.height);
  };
  int64_t rest_px = std::max(kLeastWorkPx, kWorkImages * static_cast<int64_t>(states_.size()));
  int64_t all_px = 0;
  largest_.clear();
  for (size_t i = 0; i < components.size(); ++i) {
    if (components[i].area < options_.min_blob_pixels) continue;
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

const std::vector<BlinkBlob>& BlinkFilter::FindBlobs(uint32_t time_us) {
  blobs_.clear();
  for (const Blink& blink : blinks_) {
    MarkSeeds(blink, time_us);
    for (const ComponentSums& seeds : Promising(labeller_.Finish())) {
      if (seeds.area < options_.min_blob_pixels) continue;
      const Burst burst = FindBurst(blink, seeds, time_us >> shift_);
      if (burst.found) Measure(blink, seeds, burst, time_us);
    }
  }
  return blobs_;
}

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/burst_measurer.h"

#include <algorithm>
#include <cmath>

#include "agent/detect/event/burst_shape.h"
#include "common/statistics/robust_statistics.h"

namespace rigcal::agent {
namespace {

// Of a period: pixels light up around the burst's middle by at most this much (latency, readout).
constexpr double kJitterShare = 0.12;

}  // namespace

void BurstMeasurer::Measure(const BlinkPeriod& blink, const ComponentSums& seeds,
                            const BlinkSurface& surface, std::vector<BlinkBlob>* blobs) {
  const std::optional<Burst> burst = FindBurst(blink, seeds, surface);
  if (!burst) return;
  const double jitter = kJitterShare * blink.period;
  const auto oldest = static_cast<uint32_t>(std::lround(burst->units + jitter));
  const auto newest = static_cast<uint32_t>(std::max(0L, std::lround(burst->units - blink.lit)));
  Grow(blink, seeds, surface, newest, oldest);
  Smooth(&lit_);
  if (static_cast<int>(lit_.size()) < min_pixels_) return;
  if (!IsLong(ShapeOf(lit_))) return AddBlob(blink, &lit_, *burst, surface, blobs);
  for (PixelList part : splitter_.Split(lit_, min_pixels_)) {
    AddBlob(blink, &part, *burst, surface, blobs);
  }
}

std::optional<BurstMeasurer::Burst> BurstMeasurer::FindBurst(const BlinkPeriod& blink,
                                                             const ComponentSums& seeds,
                                                             const BlinkSurface& surface) {
  const uint32_t now = surface.now();
  ages_.clear();
  double gaps = 0;
  for (int y = seeds.min_y; y <= seeds.max_y; ++y) {
    const uint32_t* const row = surface.Row(y);
    for (int x = seeds.min_x; x <= seeds.max_x; ++x) {
      if (!blink.IsSeed(row[x], now)) continue;
      ages_.push_back(blink.UnitsSinceBurst(row[x], now));
      gaps += row[x] >> 4 & BlinkRules::kMaxGap;
    }
  }
  if (ages_.empty()) return std::nullopt;
  // Between the last two bursts, mean over the pixels.
  const double period_us = gaps / static_cast<double>(ages_.size()) * (1 << surface.shift);
  if (std::abs(period_us / blink.period_us - 1) > blink.band_rel) return std::nullopt;
  // Pixels whose burst is just over and those whose next one has begun are a period apart: the
  // newest burst that most pixels took part in.
  const double start_units = UpperMedian(&ages_);
  if (start_units < 0) return std::nullopt;
  return Burst{.units = start_units, .period_us = period_us};
}

void BurstMeasurer::Grow(const BlinkPeriod& blink, const ComponentSums& seeds,
                         const BlinkSurface& surface, uint32_t newest, uint32_t oldest) {
  const uint32_t now = surface.now();
  const int x_begin = std::max(0, seeds.min_x - kReachPx);
  const int y_begin = std::max(0, seeds.min_y - kReachPx);
  const int x_end = std::min(static_cast<int>(surface.geometry.width), seeds.max_x + 1 + kReachPx);
  const int y_end = std::min(static_cast<int>(surface.geometry.height), seeds.max_y + 1 + kReachPx);
  const int width = x_end - x_begin;
  lit_.clear();
  seen_.assign(static_cast<size_t>(width) * static_cast<size_t>(y_end - y_begin), false);
  const auto visit = [&](int x, int y) {
    const auto at = static_cast<size_t>((y - y_begin) * width + x - x_begin);
    if (seen_[at]) return;
    seen_[at] = true;
    const uint32_t state = surface.Row(y)[x];
    if (!LitUpBetween(state, now, newest, oldest)) return;
    // Of a marker beside this one.
    if (blinks_.size() > 1 && IsSeedOfAnother(blink, state, now)) return;
    lit_.emplace_back(x, y);
  };
  for (int y = seeds.min_y; y <= seeds.max_y; ++y) {
    for (int x = seeds.min_x; x <= seeds.max_x; ++x) {
      if (blink.IsSeed(surface.Row(y)[x], now)) visit(x, y);
    }
  }
  for (size_t next = 0; next < lit_.size(); ++next) {
    const auto [x, y] = lit_[next];
    for (int v = std::max(y_begin, y - 1); v <= std::min(y_end - 1, y + 1); ++v) {
      for (int u = std::max(x_begin, x - 1); u <= std::min(x_end - 1, x + 1); ++u) visit(u, v);
    }
  }
}

bool BurstMeasurer::IsSeedOfAnother(const BlinkPeriod& blink, uint32_t state, uint32_t now) const {
  return std::any_of(blinks_.begin(), blinks_.end(), [&](const BlinkPeriod& other) {
    return other.index != blink.index && other.IsSeed(state, now);
  });
}

void BurstMeasurer::AddBlob(const BlinkPeriod& blink, PixelList* pixels, const Burst& burst,
                            const BlinkSurface& surface, std::vector<BlinkBlob>* blobs) {
  BlinkBlob blob{MarkerShapeOf(pixels)};
  const double unit_us = 1 << surface.shift;
  blob.burst_us = unit_us * (static_cast<double>(surface.now()) - burst.units);
  blob.period_us = burst.period_us;
  blob.time_us = blob.burst_us + 0.5 * unit_us * static_cast<double>(blink.lit);
  blob.frequency = blink.index;
  blob.touches_border = TouchesBorder(blob.box, surface.geometry);
  // Markers that have grown together are found from the seeds of each.
  for (const BlinkBlob& other : *blobs) {
    if (other.frequency == blob.frequency && (other.centre_px - blob.centre_px).squaredNorm() < 4)
      return;
  }
  blobs->push_back(blob);
}

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/detection/second_pixels.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace rigcal::accuracy {
namespace {

constexpr double kStepUs = 5;
constexpr int kSteps = 20;       // for which the discs stand still
constexpr double kAroundPx = 7;  // of a disc: where pixels may still answer
constexpr double kSlowest = 20;  // in the dark the cut-off is lower by no more

constexpr double kNothing = 1e-3;  // of ln(light)

struct SecondPixel {
  bool begun = false;
  double first = 0, second = 0;  // levels behind the low passes
  double reference = 0, ready_us = 0;
  double on = 0, off = 0;  // thresholds
};

class SecondSensor {
 public:
  SecondSensor(const SecondPixelOptions& options, const ImageSize& size)
      : options_(options),
        width_(static_cast<int>(size.width)),
        height_(static_cast<int>(size.height)),
        pixels_(static_cast<size_t>(size.width) * size.height),
        slice_of_(pixels_.size(), -1) {
    std::mt19937 random(options.seed);
    std::normal_distribution<double> factor(1, options.threshold_spread);
    for (SecondPixel& pixel : pixels_) {
      pixel.on = options.on_threshold * std::max(0.3, factor(random));
      pixel.off = options.off_threshold * std::max(0.3, factor(random));
    }
  }

  void Slice(int slice, const std::vector<MarkerGroundTruth>& discs,
             std::vector<agent::CdEvent>* events) {
    const size_t before = events->size();
    for (const MarkerGroundTruth& disc : discs) {
      const double reach = disc.radius_px + kAroundPx;
      const int x0 = std::max(0, static_cast<int>(disc.centre_px.x() - reach));
      const int x1 = std::min(width_ - 1, static_cast<int>(disc.centre_px.x() + reach));
      const int y0 = std::max(0, static_cast<int>(disc.centre_px.y() - reach));
      const int y1 = std::min(height_ - 1, static_cast<int>(disc.centre_px.y() + reach));
      for (int y = y0; y <= y1; ++y) {
        for (int x = x0; x <= x1; ++x) {
          const auto at =
              static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x);
          if (slice_of_[at] == slice) continue;
          slice_of_[at] = slice;
          Follow(slice, x, y, Cover(discs, x, y), &pixels_[at], events);
        }
      }
    }
    std::stable_sort(
        events->begin() + static_cast<std::ptrdiff_t>(before), events->end(),
        [](const agent::CdEvent& a, const agent::CdEvent& b) { return a.time_us < b.time_us; });
  }

 private:
  double Cover(const std::vector<MarkerGroundTruth>& discs, int x, int y) const {
    double cover = 0;
    for (const MarkerGroundTruth& disc : discs) {
      const double inside = disc.radius_px - (Eigen::Vector2d(x, y) - disc.centre_px).norm();
      cover += 0.5 * std::erfc(-inside / (options_.edge_px * std::numbers::sqrt2));
    }
    return std::min(1.0, cover);
  }

  // What is left of the way to a light after one step.
  double Rest(double light) const {
    const double full = 1 + options_.contrast;
    const double slower = options_.follows_light ? std::clamp(full / light, 1.0, kSlowest) : 1;
    return std::exp(-2 * std::numbers::pi * options_.cutoff_hz * 1e-6 * kStepUs / slower);
  }

  void Follow(int slice, int x, int y, double cover, SecondPixel* pixel,
              std::vector<agent::CdEvent>* events) const {
    const double dark = options_.room_share * (1 - cover) + cover;
    const double lit = dark + options_.contrast * cover;
    // Nothing of a disc is seen there, and the level has settled.
    if (pixel->begun && options_.contrast * cover < kNothing * dark &&
        std::abs(dark / options_.room_share - 1) < kNothing &&
        std::abs(pixel->second - std::log(options_.room_share)) < kNothing) {
      return;
    }
    const double level_of[] = {std::log(dark), std::log(lit)};
    const double rest_of[] = {Rest(dark), Rest(lit)};
    if (!pixel->begun) {
      pixel->begun = true;
      pixel->first = pixel->second = pixel->reference = level_of[0];
    }
    for (int step = 0; step < kSteps; ++step) {
      const double begin_us = (slice * kSteps + step) * kStepUs;
      const double turns = 1e-6 * (begin_us + 0.5 * kStepUs) * options_.blink_hz + options_.phase;
      const int is_lit = turns - std::floor(turns) < options_.duty ? 1 : 0;
      const double was = pixel->second;
      pixel->first = level_of[is_lit] + rest_of[is_lit] * (pixel->first - level_of[is_lit]);
      pixel->second = pixel->first + rest_of[is_lit] * (was - pixel->first);
      if (begin_us < pixel->ready_us) {
        pixel->reference = pixel->second;
        continue;
      }
      const double moved = pixel->second - pixel->reference;
      const bool on = moved >= pixel->on;
      if (!on && moved > -pixel->off) continue;
      const double crossing = pixel->reference + (on ? pixel->on : -pixel->off);
      const double share = std::clamp((crossing - was) / (pixel->second - was), 0.0, 1.0);
      const double at_us = begin_us + share * kStepUs;
      events->push_back(
          {static_cast<int64_t>(at_us), static_cast<uint16_t>(x), static_cast<uint16_t>(y), on});
      pixel->ready_us = at_us + options_.refractory_us;
      pixel->reference = crossing;
    }
  }

  SecondPixelOptions options_;
  int width_, height_;
  std::vector<SecondPixel> pixels_;
  std::vector<int> slice_of_;  // by pixel: the last one that it was followed in
};

}  // namespace

std::vector<agent::CdEvent> RenderSecondPixels(const SecondPixelOptions& options,
                                               const ImageSize& size, const DiscPath& discs,
                                               double duration_s) {
  SecondSensor sensor(options, size);
  std::vector<agent::CdEvent> events;
  const double slice_s = 1e-6 * kStepUs * kSteps;
  const auto slices = static_cast<int>(duration_s / slice_s);
  for (int slice = 0; slice < slices; ++slice) {
    sensor.Slice(slice, discs((slice + 0.5) * slice_s), &events);
  }
  return events;
}

}  // namespace rigcal::accuracy

// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/image_exposure.h"

#include <algorithm>
#include <cmath>

namespace rigcal::agent {
namespace {

constexpr double kUsualBlinkHz = 500;

constexpr int kStep = 16;       // pixels between two samples
constexpr int kBlackGrey = 24;  // largest grey level of a dark room or sensor, plus 1
constexpr int kSaturatedGrey = 250;

uint8_t SmallestChannel(const uint8_t* pixel, int bytes) {
  return bytes == 1 ? pixel[0] : std::min(std::min(pixel[0], pixel[1]), pixel[2]);
}

uint8_t LargestChannel(const uint8_t* pixel, int bytes) {
  return bytes == 1 ? pixel[0] : std::max(std::max(pixel[0], pixel[1]), pixel[2]);
}

}  // namespace

ImageExposure LookAtExposure(const ImageView& image) {
  const int bytes = BytesPerPixel(image.format);
  int64_t looked_at = 0, saturated = 0, lit = 0;
  for (int y = 0; y < image.height; y += kStep) {
    const uint8_t* row = image.Row(y);
    for (int x = 0; x < image.width; x += kStep) {
      const uint8_t* const pixel = row + x * bytes;
      ++looked_at;
      saturated += SmallestChannel(pixel, bytes) >= kSaturatedGrey ? 1 : 0;
      lit += LargestChannel(pixel, bytes) >= kBlackGrey ? 1 : 0;
    }
  }
  if (2 * saturated > looked_at) return ImageExposure::kSaturated;
  // Up to a thousandth of the pixels may be hot pixels, which are no light.
  return 1000 * lit <= looked_at ? ImageExposure::kBlack : ImageExposure::kUsable;
}

double WhiteShare(const ImageView& image, int least_grey) {
  const int bytes = BytesPerPixel(image.format);
  int64_t looked_at = 0, white = 0;
  for (int y = 0; y < image.height; y += kStep) {
    const uint8_t* const row = image.Row(y);
    for (int x = 0; x < image.width; x += kStep) {
      const uint8_t* const pixel = row + x * bytes;
      ++looked_at;
      white += SmallestChannel(pixel, bytes) >= least_grey ? 1 : 0;
    }
  }
  return looked_at > 0 ? static_cast<double>(white) / static_cast<double>(looked_at) : 0;
}

double LitShare(const ImageView& image) {
  const int bytes = BytesPerPixel(image.format);
  int64_t looked_at = 0, lit = 0;
  for (int y = 0; y < image.height; y += kStep) {
    const uint8_t* const row = image.Row(y);
    for (int x = 0; x < image.width; x += kStep) {
      const uint8_t* const pixel = row + x * bytes;
      ++looked_at;
      lit += LargestChannel(pixel, bytes) >= kBlackGrey ? 1 : 0;
    }
  }
  return looked_at > 0 ? static_cast<double>(lit) / static_cast<double>(looked_at) : 0;
}

double LightTimeSigma(double exposure_s, const Target& target) {
  const double hz = target.blink_hz.empty() ? 0 : target.blink_hz.front();
  if (!(exposure_s > 0) || !(hz > 0)) return 0;
  constexpr int kPhases = 64;
  constexpr double kDuty = 0.5;
  const double period_s = 1 / hz;
  const double periods = exposure_s * hz;
  if (periods > 1000) return 0;
  double squares = 0, light_sum_s = 0;
  for (int i = 0; i < kPhases; ++i) {
    double light_s = 0, moment_s2 = 0;
    for (int k = -1; k <= static_cast<int>(periods) + 1; ++k) {
      const double on_s = (k + (i + 0.5) / kPhases) * period_s;
      const double begin_s = std::clamp(on_s, 0.0, exposure_s);
      const double end_s = std::clamp(on_s + kDuty * period_s, 0.0, exposure_s);
      light_s += end_s - begin_s;
      moment_s2 += 0.5 * (end_s - begin_s) * (end_s + begin_s - exposure_s);
    }
    if (!(light_s > 0)) continue;
    squares += light_s * std::pow(moment_s2 / light_s, 2);
    light_sum_s += light_s;
  }
  return light_sum_s > 0 ? std::sqrt(squares / light_sum_s) : 0;
}

double ShortLightTimeSigma(double exposure_s, const Target& target) {
  Target blinking = target;
  if (blinking.blink_hz.empty()) blinking.blink_hz = {kUsualBlinkHz};
  return exposure_s * blinking.blink_hz.front() < 1 ? LightTimeSigma(exposure_s, blinking) : 0;
}

}  // namespace rigcal::agent

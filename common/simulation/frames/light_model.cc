// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/light_model.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace rigcal {
namespace {

constexpr double kReferenceExposureS = 0.005;
constexpr double kShellReflectance = 0.5;
constexpr double kAutoGainGrey = 200;
constexpr double kUsualDiameterM = 0.04;

}  // namespace

Bgr HueColour(double hue_deg, double saturation) {
  const auto channel = [&](double peak_deg) {
    const double away = std::abs(std::remainder(hue_deg - peak_deg, 360.0));
    const double pure = std::clamp((120 - away) / 60, 0.0, 1.0);
    return 1 - saturation * (1 - pure);
  };
  return {channel(240), channel(120), channel(0)};
}

double BlinkHz(const Target& target, const FrameRenderOptions& options, size_t marker) {
  if (target.blink_hz.empty()) return options.blink_hz;
  return target.blink_hz[std::min(marker, target.blink_hz.size() - 1)];
}

double SphereRadiusM(const Target& target) {
  return 0.5 * (target.diameter_m > 0 ? target.diameter_m : kUsualDiameterM);
}

LightModel::LightModel(const FrameRenderOptions& options) {
  const double duty = options.blink_hz > 0 ? options.blink_duty : 1;
  const double exposures = options.exposure_s / kReferenceExposureS;
  grey_per_cd_m2 = options.led_grey * exposures / (options.led_cd_m2 * duty);
  room_cd_m2 = options.lux / std::numbers::pi;
  const double shell_cd_m2 = kShellReflectance * room_cd_m2;
  const double brightest =
      options.black_grey + grey_per_cd_m2 * (options.led_cd_m2 * duty + shell_cd_m2);
  if (options.auto_gain && brightest > kAutoGainGrey) {
    grey_per_cd_m2 *= (kAutoGainGrey - options.black_grey) / (brightest - options.black_grey);
  }
  shell_grey = grey_per_cd_m2 * shell_cd_m2;
  spot_grey = grey_per_cd_m2 * kShellReflectance * options.overhead_lux / std::numbers::pi;
  led_grey = HueColour(options.led_hue_deg, options.led_saturation);
  for (double& grey : led_grey) grey *= grey_per_cd_m2 * options.led_cd_m2;
}

}  // namespace rigcal

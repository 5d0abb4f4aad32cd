// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/frame_render_options.h"

#include "absl/strings/str_join.h"
#include "common/simulation/world/option_table.h"

namespace rigcal {
namespace {

constexpr NumberOption<FrameRenderOptions> kNumbers[] = {
    {"exposure", &FrameRenderOptions::exposure_s, 1e-5, 1},
    {"led_grey", &FrameRenderOptions::led_grey, 0, 5000},
    {"led_cd_m2", &FrameRenderOptions::led_cd_m2, 1, 1e6},
    {"led_hue", &FrameRenderOptions::led_hue_deg, 0, 360},
    {"led_saturation", &FrameRenderOptions::led_saturation, 0, 1},
    {"blink_hz", &FrameRenderOptions::blink_hz, 0, 1e5},
    {"blink_duty", &FrameRenderOptions::blink_duty, 0.001, 1},
    {"blink_drift", &FrameRenderOptions::blink_drift_ppm, -1e5, 1e5},
    {"limb", &FrameRenderOptions::limb, 0, 1},
    {"defocus", &FrameRenderOptions::defocus_px, 0, 20},
    {"defocus_disc", &FrameRenderOptions::defocus_disc_px, 0, 20},
    {"vignetting", &FrameRenderOptions::vignetting, 0, 0.9},
    {"bloom", &FrameRenderOptions::bloom, 0, 1},
    {"bloom_radius", &FrameRenderOptions::bloom_radius_px, 0.5, 50},
    {"black", &FrameRenderOptions::black_grey, 0, 100},
    {"read_noise", &FrameRenderOptions::read_noise_grey, 0, 12},
    {"electrons_per_grey", &FrameRenderOptions::electrons_per_grey, 1, 1e9},
    {"lux", &FrameRenderOptions::lux, 0, 1e5},
    {"reflectance", &FrameRenderOptions::background_reflectance, 0, 1},
    {"clutter", &FrameRenderOptions::clutter, 0, 5},
    {"reflection", &FrameRenderOptions::reflection, 0, 1},
    {"occlusion", &FrameRenderOptions::occlusion, 0, 1},
};
constexpr SwitchOption<FrameRenderOptions> kSwitches[] = {
    {"auto_gain", &FrameRenderOptions::auto_gain},
};
constexpr OptionTable<FrameRenderOptions> kTable = {
    .notation = {.kind = "picture option", .example = "lux=200"},
    .numbers = kNumbers,
    .switches = kSwitches,
};

}  // namespace

absl::Status FrameRenderOptions::Validate() const {
  FaultList faults;
  kTable.Check(*this, &faults);
  // So that an exposure is made of a bounded number of flashes.
  if (blink_hz * exposure_s > 1000) {
    faults.Add("exposure ", exposure_s, " s holds more than 1000 blinks of ", blink_hz, " Hz");
  }
  return faults.Result("picture options: ");
}

bool IsFrameRenderOption(std::string_view name) { return kTable.Has(name); }

absl::StatusOr<FrameRenderOptions> ParseFrameRenderOptions(std::string_view text) {
  return kTable.Parse(text);
}

std::string FormatFrameRenderOptions(const FrameRenderOptions& options) {
  return absl::StrJoin(kTable.Format(options), ";");
}

}  // namespace rigcal

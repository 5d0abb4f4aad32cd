// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/world/simulation_options.h"

#include <algorithm>

#include "common/options/option_table.h"

namespace rigcal {
namespace {

constexpr double kMinRateHz = 0.1;
constexpr double kMaxRateHz = 1000;

}  // namespace

void AddOptions(SimulationOptions* options, OptionTable* table) {
  SimulationOptions& o = *options;
  table->Add("seed", &o.seed, {0, 4294967295}, "of everything random");
  table->Add("cameras", &o.camera_count, {2, 100}, "in a ring around the volume");
  table->Add("duration", &o.duration_s, {0.1, 86400, "s"}, "of the wave");
  table->Add("rate", &o.rate_hz, {kMinRateHz, kMaxRateHz, "Hz"}, "observations of each camera");
  table->Add("noise", &o.noise_px, {0, 100, "px"}, "one sigma of each coordinate of a centre");
  table->Add("outliers", &o.outlier_share, {0, 1}, "share of markers put anywhere in the image");
  table->Add("dropouts", &o.dropout_share, {0, 1}, "share of markers not seen");
  table->Add("swaps", &o.swap_share, {0, 1}, "share of observations with flipped labels");
  table->Add("wand_speed", &o.max_speed_m_s, {0.01, 20, "m/s"}, "highest speed of its middle");
  table->Add("jitter", &o.jitter_s, {0, 1, "s"},
             "one sigma of each timestamp; at most a tenth of the shortest period");
  table->Add("length_error", &o.length_error_m, {-0.1, 0.1, "m"}, "added to every span");
  table->Add("length_sigma", &o.length_sigma_m, {0, 0.02, "m"},
             "of a random error of each span, or of each coordinate of a rigid target's points");
  table->Add("focal_sigma", &o.focal_sigma_rel, {0, 0.05}, "relative error of fx and fy");
  table->Add("centre_sigma", &o.centre_sigma_px, {0, 100, "px"}, "error of cx and cy");
  table->Add("radial_sigma", &o.radial_sigma, {0, 0.2}, "error of k1 and k2");
  table->Add("radial_high_sigma", &o.radial_high_sigma, {0, 0.2}, "error of k3");
  table->Add("tangential_sigma", &o.tangential_sigma, {0, 0.01}, "error of p1 and p2");
  table->Add("gap_start", &o.gap_start_s, {0, 86400, "s"}, "from here on no camera sees the wand");
  table->Add("gap", &o.gap_duration_s, {0, 86400, "s"}, "for so long");
  table->Add("free_running", &o.free_running, "each camera has a phase of its own");
  table->Add("clock_samples", &o.clock_samples,
             "clocks have origins of their own, aligned by clock samples only");
  table->Add("offset", &o.time_offset_s, {-1e5, 1e5, "s"}, "time offset of camera N");
  table->Add("rate_ppm", &o.time_rate_ppm, {-10000, 10000}, "clock rate error of camera N, ppm");
  table->Add("line_delay", &o.line_delay_s, {-1e-3, 1e-3, "s"},
             "time between two image rows of camera N, a rolling shutter");
  table->Add("rate", &o.camera_rate_hz, {kMinRateHz, kMaxRateHz, "Hz"}, "of camera N alone");
  table->Add("outliers", &o.camera_outlier_share, {0, 1}, "of camera N alone");
  table->Add("second_wand", &o.camera_second_wand_share, {0, 1},
             "share of the observations of camera N that show another wand");
}

absl::Status SimulationOptions::Validate() const {
  FaultList faults;
  CheckOptions(*this, &faults);
  for (const auto& by_camera : {time_offset_s, time_rate_ppm, line_delay_s, camera_rate_hz,
                                camera_outlier_share, camera_second_wand_share}) {
    for (const auto& [index, value] : by_camera) {
      if (index >= 0 && index < camera_count) continue;
      faults.Add("there is no camera ", index, " of ", camera_count, ": they count from 0");
    }
  }
  double fastest_hz = std::clamp(rate_hz, kMinRateHz, kMaxRateHz);
  for (const auto& [index, hz] : camera_rate_hz) fastest_hz = std::max(fastest_hz, hz);
  // So that stamps with jitter still increase.
  const double most_jitter_s = 0.1 / std::min(fastest_hz, kMaxRateHz);
  if (jitter_s <= 1 && jitter_s > most_jitter_s) {
    faults.Add("jitter is ", jitter_s, " s, at these rates at most ", most_jitter_s, " s");
  }
  return faults.Result("simulation options: ");
}

std::string FormatSimulationOptions(const SimulationOptions& options) {
  return FormatOptions(options, {"seed", "cameras"});
}

}  // namespace rigcal

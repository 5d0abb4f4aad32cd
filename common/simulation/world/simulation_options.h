// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "absl/status/status.h"

namespace rigcal {

class OptionTable;

// One shared world: rig, trajectory and ground truth follow from these alone, so that every agent
// process that is given the same options simulates its own camera of the same world. Ranges: see
// AddOptions.
struct SimulationOptions {
  uint32_t seed = 1;
  int camera_count = 6;         // in a ring around the volume, neighbours 3 to 5 m apart
  double duration_s = 60;       // of the wave
  double rate_hz = 25;          // observations per second and camera
  double noise_px = 0.3;        // one sigma of each coordinate of a centre
  double outlier_share = 0.02;  // of markers, put anywhere in the image
  double dropout_share = 0.05;  // of markers, not seen
  double swap_share = 0;        // of observations, with flipped labels
  double max_speed_m_s = 1.5;   // of the wand's middle
  double jitter_s = 0;          // one sigma of each stamp; at most a tenth of the shortest period
  double length_error_m = 0;    // added to every span of the true wand, unknown to the solver
  double length_sigma_m = 0;    // one sigma of what is drawn and added to each span besides,
                                // or to each coordinate of a rigid target's points
  // One sigma of the difference between each camera's true and described intrinsics, drawn for each
  // value independently: of fx and fy, relative; of cx and cy; of k1 and k2; of k3; of p1 and p2.
  double focal_sigma_rel = 0;
  double centre_sigma_px = 0;
  double radial_sigma = 0;
  double radial_high_sigma = 0;
  double tangential_sigma = 0;
  // From this rig time on, and for how long, no camera sees the wand.
  double gap_start_s = 0;
  double gap_duration_s = 0;
  bool free_running = false;   // each camera begins its period at a phase of its own
  bool clock_samples = false;  // clocks have origins of their own, aligned by clock samples only
  // By camera index; cameras not named have 0. Same sense as in Clock.
  std::map<int, double> time_offset_s;
  std::map<int, double> time_rate_ppm;
  std::map<int, double> line_delay_s;          // see SimulatedCamera
  std::map<int, double> camera_rate_hz;        // instead of rate_hz
  std::map<int, double> camera_outlier_share;  // instead of outlier_share
  // Of observations, that show another wand on the other side of the volume.
  std::map<int, double> camera_second_wand_share;

  friend bool operator==(const SimulationOptions&, const SimulationOptions&) = default;
  bool InGap(double rig_time_s) const {
    const double gap_time_s = rig_time_s - gap_start_s;
    return gap_time_s >= 0 && gap_time_s < gap_duration_s;
  }
  // Every fault.
  absl::Status Validate() const;
};

void AddOptions(SimulationOptions* options, OptionTable* table);

// `seed=1;cameras=6;offset.2=0.008`: seed, cameras, and every part that differs from its default.
std::string FormatSimulationOptions(const SimulationOptions& options);

}  // namespace rigcal

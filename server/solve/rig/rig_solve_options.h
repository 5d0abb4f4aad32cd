// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/calibration/calibration_stage.h"
#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/rig/image_motion.h"
#include "server/solve/rig/rig_observations.h"

namespace rigcal::server {

struct HeldRig;

// How it is solved.
struct RigSolveOptions {
  int reference_camera = 0;  // into the index; its pose is the rig frame
  bool estimate_time_offsets = true;
  // Of every clock but one of each session (the reference camera's); or of those of `own_rates`, by
  // clock, alone: at least one of each session is not.
  bool estimate_time_rates = false;
  std::vector<bool> own_rates;
  // By camera: its line delay (rolling shutter) is estimated. Empty: none is.
  std::vector<bool> estimate_line_delays;
  bool refine_intrinsics = false;
  // By camera of the index, or empty: the model of its lens was found by the data, so that nothing
  // but them says its intrinsics, which are refined in any case.
  std::vector<bool> new_lens;
  // By camera of the index, or empty: its intrinsics are kept while those of others are refined.
  std::vector<bool> keep_intrinsics;
  // Cameras whose poses are held where they are known to be (held_rig.h), which gives the rig frame
  // and the scale; the reference camera is one of them. Null: none but the reference camera.
  std::shared_ptr<const HeldRig> held;
  bool estimate_marker_positions = false;
  // Between two cameras of the index, in metres: the scale of a target of one marker. None: its
  // unit is the distance from the reference camera to the camera initialized farthest from it.
  std::optional<BundleDistance> known_distance;
  double known_distance_sigma_m = 0;  // of the measurement
  double sigma_px = 0;                // instead of the observed covariances; 0 = as observed
  double tolerance_s = 0;             // of an instant; 0 = from the periods
  uint32_t seed = 0;
  std::vector<std::pair<int, int>> avoided_pairs;         // of cameras, see initialization.h
  std::vector<std::string> camera_notes;                  // for error messages
  std::function<bool(int64_t rig_time_ns)> keep_instant;  // none: all
  // Solves on about so many observations of those that are kept; 0: on all (thin_out.h).
  size_t max_observations = 0;
  // For solves that are compared, not published: begins at initial values that are good enough to
  // know outliers by, and ends where what is left to gain would not change an error in pixels.
  bool rough = false;
  // Of the tracks as they are observed, where several solves share them (MotionsOf); null: made.
  const std::vector<ImageMotion>* motions = nullptr;
  std::function<void(CalibrationStage stage, double fraction)> progress;
  const std::atomic<bool>* cancelled = nullptr;
};

// The unit of length of the solution is the metre, not the distance of two cameras.
inline bool IsMetric(const RigObservations& rig, const RigSolveOptions& options) {
  return rig.Parts().HasLengths() || options.known_distance.has_value();
}

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "absl/status/statusor.h"
#include "server/solve/calibrate.h"
#include "tests/accuracy/rig/rig_information.h"

namespace rigcal::accuracy {

// A hall whose ceiling is full of cameras that look down, ten across and as many along as there
// are: each sees a few metres of the floor, so each instant of the wand is seen by about twelve of
// them, however many there are. The wand is carried across the hall and back, once for each row of
// cameras.
struct HallOptions {
  uint32_t seed = 1;
  int camera_count = 500;        // a multiple of ten
  int instants_per_camera = 10;  // of the hall, at 10 Hz
  double noise_px = 0.3;         // one sigma of each coordinate of a centre
  double outlier_share = 0.02;   // of markers, put anywhere in the image
  double dropout_share = 0.05;   // of markers, not seen
};

struct HallRig {
  server::CalibrationInput input;  // cameras cam_000, cam_001, ...: in the order of `truth`
  // What was visible and is no outlier. The pose of the first camera is the rig frame.
  TrueRig truth;
  double cameras_per_instant = 0;  // mean
};

HallRig MakeHallRig(const HallOptions& options);

// ComputeRigBound (rig_information.h) for rigs of which an instant shows a small part: each instant
// is differentiated by its own cameras alone. Estimated are poses, time offsets and marker
// positions, the latter with this sigma of each span.
absl::StatusOr<RigBound> ComputeBoundOfParts(const TrueRig& rig, double span_sigma_m);

}  // namespace rigcal::accuracy

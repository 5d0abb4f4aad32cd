// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "common/simulation/world/simulated_world.h"

namespace rigcal::accuracy {

// What the room was measured with: one sigma each.
struct ScaleSigmas {
  double wand_span_m = 0.0003;  // of each span of the wand
  double cameras_m = 0.004;     // of the distance of two cameras, about 4 m
  double bar_m = 0.0003;        // of a bar of 1 m
};

inline constexpr int kScaleSources = 3;  // the wand, two cameras, a bar

struct ScaleTrial {
  absl::Status status;
  double error_rel = 0;       // of the fused scale, as the logarithm of its ratio to the true one
  double sigma_rel = 0;       // as stated
  double wand_sigma_rel = 0;  // of the wand alone
  bool false_alarm = false;   // a source of three good ones was named
  // By source: with it `wrong_rel` wrong it was named, and no other.
  bool named[kScaleSources] = {};
  bool other_named[kScaleSources] = {};
  double own_sigma_rel[kScaleSources] = {};
};

// Calibrates a simulated rig with a wand whose spans are not exact, and fuses its scale with a
// measured distance of two cameras and a bar that is waved afterwards.
ScaleTrial RunScaleTrial(const SimulationOptions& simulation, const ScaleSigmas& sigmas,
                         double wrong_rel);

}  // namespace rigcal::accuracy

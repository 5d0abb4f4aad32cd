// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "common/simulation/world/simulated_world.h"
#include "server/solve/rig/rig_solver.h"

namespace rigcal::accuracy {

// What became of the markers of the instants that a solve used, against the truth.
struct FateCounts {
  // Markers. Those of reversed rows that are no outliers count below instead.
  int outlier_removed = 0;
  int outlier_kept = 0;
  int good_removed = 0;
  int good_kept = 0;
  // Rows with a marker at an end that is no outlier: the middle of a wand has the same label either
  // way. A reversed row is dealt with where each such marker was turned or removed.
  int reversed_turned = 0;
  int reversed_removed = 0;
  int reversed_kept = 0;
  int straight_turned = 0;

  FateCounts& operator+=(const FateCounts& other);
  // NaN where nothing was removed, or there was nothing to find.
  double OutlierPrecision() const;
  double OutlierRecall() const;
  double ReversedRecall() const;  // turned or removed, of all reversed ones
};

FateCounts CountFates(const SimulatedWorld& world, const server::RigObservations& rig,
                      const server::RigSolution& solution);

}  // namespace rigcal::accuracy

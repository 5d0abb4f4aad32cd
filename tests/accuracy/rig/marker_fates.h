// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "common/simulation/world/simulated_world.h"
#include "server/solve/rig/rig_observations.h"
#include "server/solve/rig/rig_solution.h"

namespace rigcal::accuracy {

// The solver's decisions about the markers of the used instants, against ground truth.
struct FateCounts {
  // Markers; those of flipped rows that are no outliers are counted below.
  int outlier_removed = 0;
  int outlier_kept = 0;
  int good_removed = 0;
  int good_kept = 0;
  // Rows with an end marker that is no outlier (a middle marker keeps its label when flipped). A
  // flipped row is handled if each such marker was corrected or removed.
  int flipped_corrected = 0;
  int flipped_removed = 0;
  int flipped_kept = 0;
  int good_flipped = 0;  // correct labels that the solver flipped

  FateCounts& operator+=(const FateCounts& other);
  // NaN where nothing was removed, or there was nothing to find.
  double OutlierPrecision() const;
  double OutlierRecall() const;
  double FlippedRecall() const;  // share of flipped rows corrected or removed
};

FateCounts CountFates(const SimulatedWorld& world, const server::RigObservations& rig,
                      const server::RigSolution& solution);

}  // namespace rigcal::accuracy

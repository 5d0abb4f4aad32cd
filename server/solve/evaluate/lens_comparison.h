// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "absl/status/statusor.h"
#include "server/solve/rig/rig_observations.h"
#include "server/solve/rig/rig_solution.h"
#include "server/solve/rig/rig_solve_options.h"

namespace rigcal::server {

// How far the cameras are expected to be off with the given intrinsics, and with refined ones: one
// sigma of a camera's position after the best rigid motion of the rig, root mean square over the
// cameras, in the unit of the solution.
struct LensComparison {
  double given_m = 0;    // with what the given ones are off, as the data see it (kept_lenses.h)
  double refined_m = 0;  // with what the data leave open of the refined ones

  // Refined ones are expected to put the cameras clearly nearer.
  bool RefinedIsNearer() const;
};

// Held-out errors in pixels do not see this: lenses that the data hardly tell apart fit alike, and
// put the cameras, and what they triangulate, elsewhere. A single point far away says little about
// lenses, and a wave of a wand near the cameras much.
//
// `given` and `refined`: solutions of the same data, with their `options` but for the intrinsics;
// neither is put away. None where the data leave something undetermined.
std::optional<LensComparison> CompareLenses(const RigSolution& given, const RigSolution& refined,
                                            const RigSolveOptions& options);

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "server/associate/align_clocks.h"
#include "server/solve/rig/image_motion.h"
#include "server/solve/rig/problem_builder.h"

namespace rigcal::server {

// Moves the centres of markers' images (CentreKind::kImageBlob) to where the spheres' centres
// project, by the distances of the instants as they are placed. A perspective image of a sphere is
// an ellipse about another point: 0.13 px away for 40 mm at 1.5 m, 600 px from the image's middle.
// Once for a problem as BuildProblem made it and whose instants have been placed; those that are
// not used stay as they are. Nothing is moved where the target has no diameter, or where the
// problem's unit of length is not the metre (`is_metric`). Returns the number of centres moved.
int CorrectSphereCentres(const TargetParts& targets, const std::vector<AlignedTrack>& tracks,
                         const std::vector<ImageMotion>& motions, bool is_metric,
                         BuiltProblem* built);

}  // namespace rigcal::server

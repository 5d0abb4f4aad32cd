// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "server/solve/clocks/ray_paths.h"

namespace rigcal::server {

// Fewer matches are meaningless: the matrix has eight degrees of freedom.
inline constexpr int kMinEpipolarMatches = 40;

// The number of markers of track a that were seen by track b at the same time if its clock is off
// by `offset_s` (as in SearchTimeOffsets), of at most 250 samples of each marker.
int CountMatches(const TrackPaths& a, const TrackPaths& b, double offset_s);

// Median distance of these matches from the epipolar lines of the matrix that fits them best, in
// pixels of the tracks' mean focal length: by the normalised eight-point algorithm (Hartley 1997,
// "In defense of the eight-point algorithm"), reweighted. Infinite with fewer than `min_matches`.
double EpipolarScorePx(const TrackPaths& a, const TrackPaths& b, double offset_s, int min_matches);

}  // namespace rigcal::server

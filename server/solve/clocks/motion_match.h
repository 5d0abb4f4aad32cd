// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "server/solve/clocks/motion_spectrum.h"
#include "server/solve/clocks/ray_paths.h"

namespace rigcal::server {

// An offset of track b at which two tracks fit one epipolar geometry.
struct MotionPeak {
  double offset_s = 0;  // as in SearchTimeOffsets
  double score_px = 0;  // see EpipolarScorePx, over what both have seen
};

enum class MotionVerdict {
  kNone,       // no offset fits better than most
  kCandidate,  // one does, but not clearly: it counts where other pairs say the same
  kFound,      // one does clearly
  kAmbiguous,  // several do, about equally well: the motion repeats itself
};

struct MotionMatch {
  MotionVerdict verdict = MotionVerdict::kNone;
  std::vector<MotionPeak> peaks;  // best first; none of kNone
};

// Finds the offset between two tracks by the motion that both have seen, wherever it lies: all
// offsets with some seconds in common are scored at once (ScoreAllLags). What counts is how much
// better an offset fits than is usual with as much in common, times how much that is: a short
// overlap often fits well. The best valleys are descended into with robust scores, and compared
// with each other.
MotionMatch MatchMotion(const TrackPaths& a, const TrackPaths& b, const MotionSpectrum& spectrum_a,
                        const MotionSpectrum& spectrum_b);

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "server/solve/bundle/bundle_problem.h"

namespace rigcal::server {

// Two explanations of the same residuals along the image motion of a camera's rows: a time of its
// own for each row, and one that is linear in the image row. Both are measured from one row to the
// next, so that clocks that drift and poses that are off say nothing.
struct StampJitter {
  // One sigma of a row's time, as if normal, besides what noise and image rows explain: that of its
  // residuals, and with what the poses give way to it taken back (shown_shifts.h).
  double shown_s = 0, jitter_s = 0;
  double line_s = 0;    // RMS that is linear in the image row
  double error_px = 0;  // RMS of the residuals that the jitter makes
  int row_count = 0;    // pairs of neighbouring rows that it was measured from

  // The stamps jitter: by more than two milliseconds, and more than image rows explain.
  bool StandsOut() const;
};

// By camera of a solved problem of a line target. The shift in time with which a row fits best is
//   dt = -sum (L u')^T (L r) / sum |L u'|^2
// over its markers, with r, L and u' of bundle_problem.h; its noise is that of the residuals across
// the motion, which no time changes. Scatters are median absolute deviations.
std::vector<StampJitter> MeasureStampJitter(const BundleProblem& problem);

// By camera: its stamps jitter, and at least half as much as those that jitter most: the cameras
// beside these are pulled along.
std::vector<bool> CamerasThatJitter(const std::vector<StampJitter>& jitter);

}  // namespace rigcal::server

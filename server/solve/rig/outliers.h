// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "server/solve/bundle/bundle_problem.h"

namespace rigcal::server {

// A marker is an outlier by this rule:
//   a camera's scale is the median of its markers' whitened residual norms |r| over 1.1774 (the
//   median norm of a standard normal 2-vector), and never less than `min_scale`;
//   a marker is out when |r| > sigmas * scale, or when its camera cannot see where it should be.
// The scale follows the camera, so that one whose clock or intrinsics are off keeps its markers;
// nothing is dropped by share;
//   an instant with outliers is not used when less than `min_markers` of it are left, or those of
// one camera only: that many fit a target somewhere whichever is wrong. Of a target of one marker,
// of which a camera shows no more, two are enough.
// Errors below that are the robust loss's business.
struct OutlierOptions {
  double sigmas = 8;
  double min_scale = 1;
  int min_markers = 4;
};

// Whitened robust scale of each camera over the markers of placed instants.
std::vector<double> CameraScales(const BundleProblem& problem, const OutlierOptions& options);

// Sets `used` of every marker of every placed instant by the rule, and of the instants that are not
// used nothing. Returns how many changed.
int ClassifyOutliers(const OutlierOptions& options, BundleProblem* problem);

}  // namespace rigcal::server

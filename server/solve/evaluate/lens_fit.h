// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/evaluate/placed_views.h"

namespace rigcal::server {

// A camera's pose and free intrinsics by its own views of targets that the other cameras place: a
// problem of some 15 unknowns, whatever the size of the rig.
struct LensFit {
  BundleCamera camera;
  // Of the rotation (vector in the camera's frame, from the left), the translation, and the
  // intrinsics, those held fixed with zeros; by the residuals, where these are larger than
  // expected.
  Eigen::MatrixXd covariance;

  double IntrinsicSigma(int i) const;
};

struct LensFitOptions {
  double loss_scale = BundleOptions().loss_scale;
  // First under a loss so wide that what is far off pulls, too.
  bool from_afar = false;
};

// Begins at `camera`, whose intrinsics are free or fixed as in a bundle adjustment, under their
// priors; its pose is free. False where the views do not determine it, or a marker is not visible.
bool FitLens(const std::vector<PlacedView>& views, const BundleCamera& camera,
             const LensFitOptions& options, LensFit* fit);

// Mean errors in pixels of the views in each of `groups` groups, as many views one after the other,
// with pose and intrinsics fitted without the group (one Gauss-Newton step from the fit to all).
// Infinite where that is not determined. Empty: FitLens fails.
std::vector<double> HeldOutErrorsPx(const std::vector<PlacedView>& views,
                                    const BundleCamera& camera, int groups);

}  // namespace rigcal::server

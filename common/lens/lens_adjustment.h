// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/camera/intrinsics.h"
#include "common/geometry/rigid_transform.h"
#include "common/lens/board_view.h"
#include "common/lens/lens_model.h"

namespace rigcal {

// A lens, and where the board was in each view.
struct LensEstimate {
  LensModel model = LensModel::kPinhole4;
  Intrinsics intrinsics;  // of DistortionModelOf(model), with all its coefficients
  std::vector<RigidTransform> cam_from_board;  // view by view
  // How the board is bent: bend.x (x - a)^2 + bend.y (y - b)^2 is added to z of a point, with (a,
  // b) its middle (MiddleOfBoard). 1/m.
  Eigen::Vector2d bend_per_m = Eigen::Vector2d::Zero();
  // Noise in each coordinate of a corner, for the priors of pinhole8: numerator and denominator of
  // its radial term can grow together and cancel each other, so each of their coefficients is 0
  // with one sigma of kRationalSigma. 0: not known, no priors.
  double noise_px = 0;
};
inline constexpr double kRationalSigma = 3;

// Of the rectangle that holds all points that were seen.
Eigen::Vector2d MiddleOfBoard(const std::vector<BoardView>& views);
// The same views of the bent board: their points are no plane any more.
std::vector<BoardView> Bent(const std::vector<BoardView>& views, const Eigen::Vector2d& bend_per_m);

struct LensAdjustmentOptions {
  bool fix_intrinsics = false;
  bool estimate_bend = false;  // else it stays as it is
  // Cauchy's loss: an error of this size counts half (in the gradient). 0: least squares.
  double loss_px = 0;
  int max_steps = 60;
};

struct LensAdjustment {
  LensEstimate estimate;
  double cost_px2 = 0;  // sum over the corners, of squared distances or of the loss of them
  // Of the free intrinsics, with the poses eliminated, for errors of 1 px in each coordinate;
  // FreeIntrinsics(model) square. Empty where they were fixed. An estimated bend is two rows more.
  Eigen::MatrixXd information;
};

// Least squares of the distances between corners and projected board points, over the intrinsics
// and all poses: Levenberg and Marquardt, the poses eliminated by the Schur complement (Triggs et
// al. 2000, "Bundle adjustment: a modern synthesis", section 6). A point that the lens cannot see
// costs kUnseenPx^2 and has no gradient. `start` has a pose for each view. It always returns the
// best that it has come to.
inline constexpr double kUnseenPx = 1e4;
LensAdjustment AdjustLens(const std::vector<BoardView>& views, const LensEstimate& start,
                          const LensAdjustmentOptions& options = {});

// Distance of each corner of a view from where the estimate projects it, pixels; kUnseenPx where it
// is not seen.
std::vector<double> CornerErrors(const BoardView& view, const Intrinsics& intrinsics,
                                 const RigidTransform& cam_from_board);

}  // namespace rigcal

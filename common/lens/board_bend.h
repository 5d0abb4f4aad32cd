// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/lens/board_view.h"
#include "common/lens/lens_adjustment.h"

namespace rigcal {

// A board that is no plane: paraboloid about its middle (LensEstimate::bend_per_m).
struct BoardBend {
  Eigen::Vector2d per_m = Eigen::Vector2d::Zero();     // along x and y
  Eigen::Vector2d height_m = Eigen::Vector2d::Zero();  // from the middle to the border
  Eigen::Vector2d sigma_m = Eigen::Vector2d::Zero();   // of it, by noise alone
};

struct BentAdjustment {
  LensAdjustment adjusted;
  BoardBend bend;
  double noise_px = 0;  // of the corners in each coordinate, by the residuals
  // Of the intrinsics alone, the bend eliminated, for that noise; empty: they are not determined.
  Eigen::MatrixXd information;
};

// The lens of these views and the bend of their board in one solve, with Cauchy's loss of
// `loss_px`. `start` has a pose for each view.
BentAdjustment AdjustWithBend(const std::vector<BoardView>& views, const LensEstimate& start,
                              double loss_px);

// Noise in each coordinate of a corner that makes the residuals of an adjustment, px.
double NoiseOf(const LensAdjustment& adjusted, const std::vector<BoardView>& views);

}  // namespace rigcal

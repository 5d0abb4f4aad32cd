// SPDX-License-Identifier: Apache-2.0
#include "common/lens/board_bend.h"

#include <algorithm>
#include <cmath>

#include "common/lens/lens_uncertainty.h"

namespace rigcal {

double NoiseOf(const LensAdjustment& adjusted, const std::vector<BoardView>& views) {
  double freedom = -static_cast<double>(adjusted.information.rows());
  for (const BoardView& view : views) freedom += 2.0 * static_cast<double>(view.corners.size()) - 6;
  return std::sqrt(adjusted.cost_px2 / std::max(1.0, freedom));
}

BentAdjustment AdjustWithBend(const std::vector<BoardView>& views, const LensEstimate& start,
                              double loss_px) {
  LensAdjustmentOptions options;
  options.estimate_bend = true;
  options.loss_px = loss_px;
  BentAdjustment result;
  result.adjusted = AdjustLens(views, start, options);
  result.noise_px = std::max(NoiseOf(result.adjusted, views), kLeastNoisePx);
  const Eigen::MatrixXd covariance =
      CovarianceOf(result.adjusted.information / (result.noise_px * result.noise_px));
  if (covariance.size() == 0) return result;
  const Eigen::Index free = covariance.rows() - 2;
  result.information = CovarianceOf(covariance.topLeftCorner(free, free));
  const Eigen::Vector2d middle_m = MiddleOfBoard(views);
  Eigen::Array2d reach_m(0, 0);
  for (const BoardView& view : views) {
    for (const BoardCorner& corner : view.corners) {
      reach_m = reach_m.max((corner.x_in_board_m.head<2>() - middle_m).array().abs());
    }
  }
  result.bend.per_m = result.adjusted.estimate.bend_per_m;
  result.bend.height_m = result.bend.per_m.array() * reach_m.square();
  result.bend.sigma_m = covariance.diagonal().tail<2>().array().sqrt() * reach_m.square();
  return result;
}

}  // namespace rigcal

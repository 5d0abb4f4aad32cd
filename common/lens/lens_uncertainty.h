// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/camera/intrinsics.h"
#include "common/lens/lens_model.h"

namespace rigcal {

// How far a lens is expected to be from the true one over the image, by the noise of the corners
// alone: one sigma (the root of the mean squared distance), after the rotation that CompareLenses
// takes out. Infinite where the views do not determine the lens.
struct LensUncertainty {
  double median_px = 0;
  double p95_px = 0;           // 95 % of the image are below
  std::vector<double> map_px;  // rows of LensDifference's grid; not a number without a ray
};

// Exact corners do not make a lens exact.
inline constexpr double kLeastNoisePx = 1e-6;

// How projection over the image follows small changes of a lens. The rotation that makes the
// distances least is taken out to first order: a lens and the orientation of its camera cannot be
// told apart.
class LensSensitivity {
 public:
  // At every `stride`-th pixel of LensDifference's grid.
  LensSensitivity(LensModel model, const Intrinsics& intrinsics, const ImageSize& image_size_px,
                  int stride = 1);

  // Of the inverse of an information matrix of the free intrinsics; `covariance` may be empty: not
  // determined.
  LensUncertainty Of(const Eigen::MatrixXd& covariance) const;
  // The mean over the image of the variances, px^2; infinite for an empty `covariance`.
  double MeanVariance(const Eigen::MatrixXd& covariance) const;

 private:
  // Of the pixels that have a ray, in the order of the grid; d pixel / d free intrinsics.
  std::vector<Eigen::Matrix<double, 2, Eigen::Dynamic>> d_pixels_;
  std::vector<bool> has_ray_;    // of every pixel
  Eigen::MatrixXd mean_square_;  // of d_pixels_
};

// The inverse of an information matrix whose rows may be of very different size. Empty: it has
// none.
Eigen::MatrixXd CovarianceOf(const Eigen::MatrixXd& information);

}  // namespace rigcal

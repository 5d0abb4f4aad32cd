// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "agent/identify/outline_pixels.h"

namespace rigcal::agent {

// Parameters of a sphere's outline; SphereOutlineFitter has the formula.
enum OutlineParameter : int {
  kOutlineX,
  kOutlineY,
  kOutlineRadius,
  kOutlineStretch,     // p
  kOutlineShear,       // q
  kOutlineEdge,        // s, px^2
  kOutlineEdgeCos,     // b
  kOutlineEdgeSin,     // c
  kOutlineBrightness,  // a
  kOutlineSlopeX,      // g; with white light Dx and Dy
  kOutlineSlopeY,
  kOutlineBendAlong,     // h1; with white light Dz
  kOutlineBendDiagonal,  // h2; with white light o
  kOutlineBendRound,     // h3
  kOutlineOwnX,          // with white light only: g of the own light
  kOutlineOwnY,
  kOutlineSky,       // with white light only: k
  kOutlineOutshone,  // e, px
  kOutlineCount
};

// Sums over the pixels' weights in a robust loss: weight = 1 / spread, spread = 1 + (residual /
// width)^2, residuals in sigmas. Pixels of precision 0 do not count.
struct OutlineWeights {
  double log_spreads = 0, weights = 0;      // sums of log(spread) and of the weight
  double squared_weights = 0, squares = 0;  // sums of weight^2 and of (weight * residual)^2
};

// The model and its derivatives. Each group of pixels has kOutlineCount rows of derivatives and one
// row of values, each of kGroup pixels.
class OutlineRows {
 public:
  // Computes the model for `parameters` (kOutlineCount of them). With `white_light` the sphere is
  // shaded by white light, not by its own. Without it, and if no background is saturated, the model
  // has only the parameters before kOutlineOwnX.
  void Model(const OutlinePixels& pixels, const float* parameters, bool white_light = false);
  // The same with the derivative by the radius only.
  void ModelEdge(const OutlinePixels& pixels, const float* parameters, bool white_light);

  float value(size_t pixel) const { return Of(kOutlineCount, pixel); }
  float slope(OutlineParameter parameter, size_t pixel) const { return Of(parameter, pixel); }

  // Writes coverage minus model into `residual`, and the robust weight times squared precision into
  // `weight`. `width` of the loss is in sigmas.
  OutlineWeights Weigh(const OutlinePixels& pixels, float width, std::vector<float>* residual,
                       std::vector<float>* weight) const;

  // Writes the sums of weight * slope_i * slope_j over the model's parameters into the lower
  // triangle of `products` (kOutlineCount^2, row by row), and those of weight * slope_i * residual
  // into `gradient`.
  void Sum(const std::vector<float>& weight, const std::vector<float>& residual, float* products,
           float* gradient);

 private:
  static constexpr size_t kStride = (kOutlineCount + 1) * OutlinePixels::kGroup;

  float Of(int row, size_t pixel) const {
    return rows_[pixel / OutlinePixels::kGroup * kStride +
                 static_cast<size_t>(row) * OutlinePixels::kGroup + pixel % OutlinePixels::kGroup];
  }

  std::vector<float> rows_;
  bool has_all_ = true;  // the model has all parameters
};

}  // namespace rigcal::agent

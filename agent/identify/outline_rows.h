// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "agent/identify/outline_pixels.h"

namespace rigcal::agent {

// Parameters of a sphere's outline, see SphereOutlineFitter.
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
  kOutlineSlopeX,      // g; of white light Dx and Dy
  kOutlineSlopeY,
  kOutlineBendAlong,     // h1; of white light Dz
  kOutlineBendDiagonal,  // h2; of white light o
  kOutlineBendRound,     // h3
  kOutlineOwnX,          // of white light only: the own light's g
  kOutlineOwnY,
  kOutlineSky,       // and k
  kOutlineOutshone,  // e, px
  kOutlineCount
};

// Of the weights of a robust loss (1 / spread, spread = 1 + (residual / width)^2), over the pixels
// that count; residuals in sigmas.
struct OutlineWeights {
  double log_spreads = 0, weights = 0;      // sums
  double squared_weights = 0, squares = 0;  // sums of weight^2 and of (weight * residual)^2
};

// Model and its derivatives: for each group of pixels kOutlineCount derivatives, then the value,
// each of kGroup pixels.
class OutlineRows {
 public:
  // Fills it with the model of `parameters` (kOutlineCount of them). `white_light`: it is white
  // light that shades the sphere, not its own. Without it, and where no background is saturated,
  // the model has those before kOutlineOwnX only.
  void Model(const OutlinePixels& pixels, const float* parameters, bool white_light = false);
  // The same with the derivative by the radius only.
  void ModelEdge(const OutlinePixels& pixels, const float* parameters, bool white_light);

  float value(size_t pixel) const { return Of(kOutlineCount, pixel); }
  float slope(OutlineParameter parameter, size_t pixel) const { return Of(parameter, pixel); }

  // What the pixels' coverages are above the model into `residual`, and their robust weights times
  // squared precision into `weight`. `width`: of the loss, in sigmas.
  OutlineWeights Weigh(const OutlinePixels& pixels, float width, std::vector<float>* residual,
                       std::vector<float>* weight) const;

  // Sums of weight * slope_i * slope_j, of the parameters that the model has, into the lower
  // triangle of `products` (kOutlineCount^2, row by row) and of weight * slope_i * residual into
  // `gradient`. `weight` and `residual`: of each pixel.
  void Sum(const std::vector<float>& weight, const std::vector<float>& residual, float* products,
           float* gradient);

 private:
  static constexpr size_t kStride = (kOutlineCount + 1) * OutlinePixels::kGroup;

  float Of(int row, size_t pixel) const {
    return rows_[pixel / OutlinePixels::kGroup * kStride +
                 static_cast<size_t>(row) * OutlinePixels::kGroup + pixel % OutlinePixels::kGroup];
  }

  std::vector<float> rows_;
  bool has_all_ = true;  // all parameters are the model's
};

}  // namespace rigcal::agent

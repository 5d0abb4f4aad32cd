// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

#include "agent/identify/outline_rows.h"

namespace rigcal::agent {

// What is expected of the light on a sphere.
struct SphereShading {
  static constexpr double kAnySlope = 0.5;  // leaves any light possible
  double slope_sigma = kAnySlope;  // one sigma of the relative slopes of its own brightness
  // White light shades the sphere, more in channels in which the marker is darker. Otherwise the
  // marker's own light is uneven, alike in all channels.
  bool white = false;
};

// What the outlines of other spheres say about this one. 0 or less: not known.
struct OutlineExpectation {
  double radius_px = 0, radius_sigma_px = 0;
  double edge_px2 = 0, edge_sigma_px2 = 0;  // square of the edge's softness
  Eigen::Vector2d stretch = Eigen::Vector2d::Zero();
  double stretch_sigma = 0;
};

// Sectors of an outline, by direction.
inline constexpr size_t kOutlineSectors = 16;

// Returns a sector, from 0; `offset` is from the outline's centre.
size_t OutlineSector(double offset_x, double offset_y);

// Parts of an outline: the sectors, without the stick, and then the stick's two sides.
inline constexpr size_t kOutlineParts = kOutlineSectors + 2;

// Returns the part of a pixel in an outline with this centre.
size_t OutlinePart(const OutlinePixels& pixels, size_t pixel, const Eigen::Vector2d& centre_px);

struct SphereOutline {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();  // of the ellipse
  // From the noise that the pixels are said to have.
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Identity();
  double radius_px = 0;  // geometric mean of the semi-axes
  // The ellipse is longer along (cos t, sin t) by a factor e^(2 |stretch|), with stretch =
  // |stretch| (cos 2t, sin 2t).
  Eigen::Vector2d stretch = Eigen::Vector2d::Zero();
  double edge_px = 0;     // one sigma of the edge's softness
  double brightness = 1;  // in the middle, in units of coverage
  double residual = 0;    // weighted root mean square, over one sigma of noise
  // Share of a shift of all pixels that the robust weights follow. The centre's covariance is that
  // of the noise over this share.
  double follows = 1;
  double pixel_noise = 1;  // variance by the residuals, over the stated one
  double cost = 0;         // of the robust fit, half a chi-squared
  bool white = false;      // SphereShading::white
  // Sum over the sectors of the squared distance between edge and outline, over its variance by the
  // pixels' noise, and its degrees of freedom. Noise that neighbouring pixels share and a model
  // that does not fit make it larger.
  double edge_chi_squared = 0, edge_freedom = 0;
  // Shares of the sectors, 0 to 1: with the edge on the outline, and with the edge elsewhere by
  // more than noise explains. The others show no edge: something else is there, or the same grey.
  double on_outline = 0, off_outline = 0;
  // Relative slopes of brightness, per radius, and their covariance by the same noise.
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();
  Eigen::Matrix2d slope_covariance = Eigen::Matrix2d::Identity();
  // The same for the sphere's own light, without white light.
  Eigen::Vector2d own_slope = Eigen::Vector2d::Zero();
  Eigen::Matrix2d own_slope_covariance = Eigen::Matrix2d::Identity();
  // Chi-squared of `slope`, two degrees of freedom: noise alone gives 2 in the mean.
  double slope_chi_squared = 0;
  // By part: score / information is how far outside of the outline the edge is, px, and 1 /
  // information is its variance by the pixels' noise.
  std::array<double, kOutlineParts> sector_score{}, sector_information{};
  Eigen::Matrix<double, kOutlineCount, 1> parameters =
      Eigen::Matrix<double, kOutlineCount, 1>::Zero();

  // Second moment of the ellipse, evenly filled, px^2.
  Eigen::Matrix2d SecondMoment() const;
};

// Finds the outline of a sphere whatever the light on it: an ellipse with a soft edge, whose
// brightness inside is a polynomial of second degree. Light from above, an LED nearer to one side
// and a dark rim move the centroid of the brightness by a quarter of the radius times their
// relative change, but not the outline.
//
// The model of a pixel at x is
//   m = F(rho / sigma) (a + g . u + h1 (ux^2 - uy^2) + 2 h2 ux uy + h3 (|u|^2 - 1/2)),
//   u = W (x - centre),   W = [1 + p, q; q, 1 - p] / radius,
// or, where white light from one direction D shades it,
//   m = F(rho / sigma) (a + g . u + w (max(0, D . n) + k D . n) + o (w - 1) + h3 (|u|^2 - 1/2)),
//   n = (ux, uy, sqrt(1 - |u|^2)),  towards the camera,  w: see OutlinePixels::white,
// which is Lambert's law on a sphere under a lamp and under a ceiling or sky that is as bright as k
// says (an even half of a sky lights a surface by (1 + n . up) / 2); a polynomial in its place
// moves the centre by up to 0.1 px. Coverages are 1 where the sphere was measured, white light
// included, in each channel: o is what this light adds there, negative. rho is the distance to the
// outline |u| = 1 to first order, positive inside. F is the distribution of density (1 - t^2)^2,
// nearly normal and of finite extent. sigma^2 = s (1 + b cos 2t + c sin 2t) depends on the
// direction t of the outline's normal, because motion blurs some sides more than others. Where the
// background is saturated, rho is less by e and the edge half as wide: a pixel of a window that is
// many times as bright as the sensor can tell stays white until the sphere covers nearly all of it.
//
// The fit is Levenberg-Marquardt with Cauchy weights, and weak priors for what a small image does
// not determine. The slopes g are expected to be 0 within `slope_sigma`: in a small image with even
// light they cost precision and give nothing. Buffers are kept; one thread at a time.
class SphereOutlineFitter {
 public:
  // `pixels` are filled up to whole groups. `start`: centre and radius, or all parameters of an
  // earlier fit; it receives the result. `shape`: second moment of the coverage, whose axes give
  // the prior shape. False: it did not converge, or not to a sphere where `start` is.
  bool Fit(const OutlinePixels& pixels, const Eigen::Matrix2d& shape, const SphereShading& light,
           SphereOutline* start, const OutlineExpectation& others = {});

  // Measures where the edge of an outline is in other pixels than it was fitted to.
  void MeasureEdge(const OutlinePixels& pixels, SphereOutline* outline);

 private:
  using Vector = Eigen::Matrix<double, kOutlineCount, 1>;
  using Matrix = Eigen::Matrix<double, kOutlineCount, kOutlineCount>;
  // Normal equations of the robust cost.
  struct System {
    Matrix information = Matrix::Zero();  // lower triangle
    Vector gradient = Vector::Zero();     // downhill
    double cost = 0;
    // Sums over the pixels: (weight * residual)^2; weight; weight^2.
    double squares = 0, weights = 0, slopes = 0;
  };
  // Computes residuals, robust weights and their sums for the model in rows_.
  void Weigh(const OutlinePixels& pixels, System* system);
  // Returns the cost of the model with these parameters.
  System Evaluate(const OutlinePixels& pixels, const Vector& parameters, bool white_light);
  // Adds the normal equations of what was evaluated last.
  void SumProducts(System* system);
  void ReadEdge(const OutlinePixels& pixels, SphereOutline* outline) const;

  float wider_loss_ = 1;  // factor of the usual width of the robust loss
  OutlineRows rows_;
  std::vector<float> residual_, weight_;
};

}  // namespace rigcal::agent

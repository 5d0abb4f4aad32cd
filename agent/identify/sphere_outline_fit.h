// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>

namespace rigcal::agent {

// A pixel around a sphere's image.
struct CoveragePixel {
  Eigen::Vector2d at_px = Eigen::Vector2d::Zero();
  // Its light between the background (0) and the mean of the sphere (1); shading and noise take it
  // beyond both.
  double coverage = 0;
};

struct SphereOutline {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();  // of the ellipse
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Identity();
  double radius_px = 0;  // geometric mean of the semi-axes
  // The ellipse is longer along (cos t, sin t) by a factor e^(2 |stretch|), with stretch =
  // |stretch| (cos 2t, sin 2t).
  Eigen::Vector2d stretch = Eigen::Vector2d::Zero();
  double edge_px = 0;     // one sigma of the edge's softness
  double brightness = 1;  // in its middle, in units of coverage
  double residual = 0;    // root mean square, in units of coverage
  // Of the slopes of brightness (two degrees of freedom): normal noise alone gives 2 in the mean.
  double slope_chi_squared = 0;
};

// Where the outline of a sphere is, whatever the light on it: an ellipse with a soft edge whose
// brightness inside is a polynomial of second degree. A lamp from above, a LED that is nearer to
// one side, and a dark rim move the centroid of the brightness by a quarter of the radius times
// their relative change; they do not move the outline.
//
// The model of a pixel at x is
//   m = Phi(rho / sigma) (a + g . u + h1 (ux^2 - uy^2) + 2 h2 ux uy + h3 (|u|^2 - 1/2)),
//   u = W (x - centre),   W = [1 + p, q; q, 1 - p] / radius,
// with rho the distance to the outline |u| = 1 to first order, positive inside; Phi the normal
// distribution; and sigma^2 = s (1 + b cos 2t + c sin 2t) by the direction t of the outline's
// normal, so that motion blurs some sides more than others. Levenberg-Marquardt with weights of the
// Cauchy distribution, weak priors for what a small image does not determine. Without `shaded` the
// slopes g are 0: in a small image that is evenly lit they cost precision and give nothing.
//
// `start`: centre, radius and covariance (not read). `shape`: second moment of the coverage, whose
// axes give the ellipse's prior shape. `noise`: one sigma of a pixel's coverage. False: it did not
// converge, or to something else than a sphere where `start` is.
bool FitSphereOutline(std::span<const CoveragePixel> pixels, const Eigen::Matrix2d& shape,
                      double noise, bool shaded, SphereOutline* start);

}  // namespace rigcal::agent

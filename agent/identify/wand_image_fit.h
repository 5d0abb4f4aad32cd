// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "absl/types/span.h"

namespace rigcal::agent {

// One marker as the camera sees it.
struct MarkerSight {
  Eigen::Vector3d ray = Eigen::Vector3d::UnitZ();  // unit vector, frame `cam`
  double scale_px = 1;                             // pixels per radian around the ray
  double sigma_px = 0.5;                           // one sigma of its place, in each direction
  double radius_px = 1;                            // of a disc with the area of its image
  double radius_sigma_px = 1;  // one sigma, without errors that all markers share
};

struct WandImageFitOptions {
  double diameter_m = 0;        // 0: not known; then only the ratios of the radii count
  double span_sigma_m = 0.002;  // one sigma of each span, and of each marker across the wand
  double min_distance_m = 0.3;
  double max_distance_m = 20;
  double max_tilt_rad = 1.43;  // out of the plane across the line of sight
};

struct WandImageFit {
  double cost = 0;                                    // chi-squared
  Eigen::Vector3d first_m = Eigen::Vector3d::Zero();  // ends, frame `cam`
  Eigen::Vector3d last_m = Eigen::Vector3d::Zero();
  double tilt_rad = 0;
};

// Fits a wand of `length_m` to its markers; `shares` are their positions along it, 0 to 1.
//
// N collinear points in space have 5 degrees of freedom, their images 2 N coordinates. The two ends
// fix the pose but for the tilt: with unit rays r0, r1 the ends are d0 r0 and d0 e^t r1, where t is
// the logarithm of the ratio of their distances and d0 follows from the length. The tilt is what
// best explains where each inner marker lies between its neighbours (in a small image the
// projective ratio is |m0 m1| / |m1 m2| = s (d2 / d0), with s the ratio on the wand) and how large
// each image is, which goes with 1 / distance. Across the line each inner marker must lie in the
// plane of the end rays.
//
// Returns false if no tilt gives a wand within the limits of distance and tilt.
bool FitWand(absl::Span<const MarkerSight> sights, absl::Span<const double> shares, double length_m,
             const WandImageFitOptions& options, WandImageFit* fit);

}  // namespace rigcal::agent

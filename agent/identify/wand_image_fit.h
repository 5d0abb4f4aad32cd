// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "absl/types/span.h"

namespace rigcal::agent {

// One marker as the camera sees it.
struct MarkerSight {
  Eigen::Vector3d ray = Eigen::Vector3d::UnitZ();  // unit, frame `cam`
  double scale_px = 1;                             // pixels per radian around it
  double sigma_px = 0.5;                           // of its position, each direction
  double radius_px = 1;                            // of a disc with the area of its image
  double radius_sigma_px = 1;                      // without what all markers share
};

struct WandImageFitOptions {
  double diameter_m = 0;        // 0: not known; then only the ratios of the radii count
  double span_sigma_m = 0.002;  // of each span, and of each marker across the wand
  double min_distance_m = 0.3;
  double max_distance_m = 20;
  double max_tilt_rad = 1.43;  // out of the plane across the line of sight
};

struct WandImageFit {
  double cost = 0;                                    // chi-squared
  Eigen::Vector3d first_m = Eigen::Vector3d::Zero();  // frame `cam`
  Eigen::Vector3d last_m = Eigen::Vector3d::Zero();
  double tilt_rad = 0;
};

// Fits a wand to markers seen. `shares` are their positions along the wand of `length_m`, first 0,
// last 1.
//
// N collinear points in space have 5 degrees of freedom, their images 2 N coordinates. The two ends
// fix the pose but for the tilt: with unit rays r0, r1 the ends are d0 r0 and d0 e^t r1, where t is
// the logarithm of the ratio of their distances and d0 follows from the length. The tilt is then
// what explains best where between its neighbours each inner marker lies (the projective ratio |m0
// m1| / |m1 m2| = s (d2 / d0) with small images) and how large each image is, which goes with 1 /
// distance. A wand with no tilt that explains them is none. Across the line each inner marker must
// lie in the plane of the end rays.
//
// False: no tilt gives a wand within the limits of distance and tilt.
bool FitWand(absl::Span<const MarkerSight> sights, absl::Span<const double> shares, double length_m,
             const WandImageFitOptions& options, WandImageFit* fit);

}  // namespace rigcal::agent

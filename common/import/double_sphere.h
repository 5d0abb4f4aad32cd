// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>

#include "absl/status/status.h"

namespace rigcal {

// A lens of the double sphere model (Usenko, Demmel and Cremers, "The Double Sphere Camera Model",
// 3DV 2018), as files of kalibr and Basalt have it. rigcal has no such lens: FitLens finds the
// nearest of its own. The centre of the first pixel is (0, 0).
struct DoubleSphere {
  double xi = 0;     // between the centres of the two spheres
  double alpha = 0;  // from the second sphere's centre to the pinhole: alpha / (1 - alpha)
  double fx_px = 0;
  double fy_px = 0;
  double cx_px = 0;
  double cy_px = 0;

  // Every fault: values that are not finite, focal lengths that are not positive, xi outside (-1,
  // 1), alpha outside [0, 1].
  absl::Status Validate() const;

  // The direction in frame `cam` that a pixel looks along, of any length, z <= 0 at 90 degrees from
  // the axis and more (section 3.3, equations 46 to 52). None: the model shows nothing there, which
  // is beyond a circle about the principal point where alpha is more than 0.5.
  std::optional<Eigen::Vector3d> Ray(const Eigen::Vector2d& pixel) const;
};

}  // namespace rigcal

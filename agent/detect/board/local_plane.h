// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <utility>
#include <vector>

namespace rigcal::agent {

// A point of the printed pattern (metres, x right, y down) and the pixel that shows it.
using PatternPixel = std::pair<Eigen::Vector2d, Eigen::Vector2d>;

// What a camera shows of a part of the pattern that is so small that no lens bends it: a
// homography.
class LocalPlane {
 public:
  explicit LocalPlane(const Eigen::Matrix3d& img_from_pattern)
      : img_from_pattern_(img_from_pattern) {}

  // By least squares over four points or more (direct linear transform, coordinates normalised:
  // Hartley and Zisserman 2004, 4.1 and 4.4). None: fewer, or all of them on a line.
  static std::optional<LocalPlane> Through(const std::vector<PatternPixel>& points);

  const Eigen::Matrix3d& img_from_pattern() const { return img_from_pattern_; }
  Eigen::Vector2d At(const Eigen::Vector2d& pattern_m) const {
    return (img_from_pattern_ * pattern_m.homogeneous()).hnormalized();
  }
  // How pixels move with metres there, one column for x and one for y.
  Eigen::Matrix2d SlopeAt(const Eigen::Vector2d& pattern_m) const;
  // The same plane shown elsewhere in the image.
  LocalPlane Moved(const Eigen::Vector2d& by_px) const;

 private:
  Eigen::Matrix3d img_from_pattern_;
};

}  // namespace rigcal::agent

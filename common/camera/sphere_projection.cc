// SPDX-License-Identifier: Apache-2.0
#include "common/camera/sphere_projection.h"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "common/camera/camera_model.h"

namespace rigcal {
namespace {

// The integrands are smooth and periodic, so that equal steps converge faster than any power.
constexpr int kOutlineSteps = 16;

}  // namespace

bool ProjectSphere(const Intrinsics& intrinsics, const Eigen::Vector3d& centre_in_cam_m,
                   double diameter_m, SphereProjection* image) {
  const double distance_m = centre_in_cam_m.norm();
  const double sine = 0.5 * diameter_m / distance_m;
  if (!(sine > 0) || !(sine < 1)) return false;
  const double cosine = std::sqrt(1 - sine * sine);
  const Eigen::Vector3d axis = centre_in_cam_m / distance_m;
  const Eigen::Vector3d across = axis.unitOrthogonal(), up = axis.cross(across);

  SphereProjection result;
  if (!Project(intrinsics, centre_in_cam_m, &result.centre_px)) return false;
  double area = 0, moment_x = 0, moment_y = 0;
  for (int i = 0; i < kOutlineSteps; ++i) {
    const double angle = 2 * std::numbers::pi * i / kOutlineSteps;
    const double c = std::cos(angle), s = std::sin(angle);
    const Eigen::Vector3d ray = cosine * axis + sine * (c * across + s * up);
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> d_pixel_d_ray;
    if (!Project(intrinsics, ray, &pixel, &d_pixel_d_ray)) return false;
    const Eigen::Vector2d step = d_pixel_d_ray * (sine * (c * up - s * across));
    const Eigen::Vector2d p = pixel - result.centre_px;
    area += 0.5 * (p.x() * step.y() - p.y() * step.x());
    moment_x += 0.5 * p.x() * p.x() * step.y();
    moment_y -= 0.5 * p.y() * p.y() * step.x();
  }
  if (!(std::abs(area) > 0) || !std::isfinite(area)) return false;
  result.centroid_px = result.centre_px + Eigen::Vector2d(moment_x, moment_y) / area;
  result.area_px2 = std::abs(area) * 2 * std::numbers::pi / kOutlineSteps;
  *image = result;
  return true;
}

bool SphereCentreFromCentroid(const Intrinsics& intrinsics, const Eigen::Vector2d& centroid_px,
                              double distance_m, double diameter_m, Eigen::Vector2d* centre_px) {
  Eigen::Vector2d centre = centroid_px;
  // The offset changes over the image much more slowly than by its own size.
  constexpr int kIterations = 3;
  for (int i = 0; i < kIterations; ++i) {
    const auto normalised = Undistort(intrinsics, centre);
    if (!normalised.ok()) return false;
    SphereProjection image;
    if (!ProjectSphere(intrinsics, normalised->homogeneous().normalized() * distance_m, diameter_m,
                       &image)) {
      return false;
    }
    centre = centroid_px - (image.centroid_px - image.centre_px);
  }
  *centre_px = centre;
  return true;
}

}  // namespace rigcal

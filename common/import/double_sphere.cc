// SPDX-License-Identifier: Apache-2.0
#include "common/import/double_sphere.h"

#include <cmath>

#include "common/status/fault_list.h"

namespace rigcal {

absl::Status DoubleSphere::Validate() const {
  FaultList faults;
  if (!(xi > -1 && xi < 1)) faults.Add("xi is ", xi, ", it must be between -1 and 1");
  if (!(alpha >= 0 && alpha <= 1)) faults.Add("alpha is ", alpha, ", it must be 0 to 1");
  if (!(fx_px > 0 && fy_px > 0 && std::isfinite(fx_px) && std::isfinite(fy_px))) {
    faults.Add("the focal lengths are ", fx_px, " and ", fy_px, " px, they must be positive");
  }
  if (!std::isfinite(cx_px) || !std::isfinite(cy_px)) {
    faults.Add("the principal point is ", cx_px, ", ", cy_px, ", not finite");
  }
  return faults.Result();
}

std::optional<Eigen::Vector3d> DoubleSphere::Ray(const Eigen::Vector2d& pixel) const {
  const Eigen::Vector2d m((pixel.x() - cx_px) / fx_px, (pixel.y() - cy_px) / fy_px);
  const double r2 = m.squaredNorm();
  const double inside = 1 - (2 * alpha - 1) * r2;
  if (!(inside >= 0)) return std::nullopt;
  const double z = (1 - alpha * alpha * r2) / (alpha * std::sqrt(inside) + 1 - alpha);
  const double length = (z * xi + std::sqrt(z * z + (1 - xi * xi) * r2)) / (z * z + r2);
  const Eigen::Vector3d ray(length * m.x(), length * m.y(), length * z - xi);
  if (!ray.allFinite()) return std::nullopt;
  return ray;
}

}  // namespace rigcal

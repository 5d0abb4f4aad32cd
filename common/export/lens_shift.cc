// SPDX-License-Identifier: Apache-2.0
#include "common/export/lens_shift.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/camera/camera_model.h"

namespace rigcal {

double LensShiftPx(const ExportedCamera& camera) {
  constexpr int kSteps = 32;
  const Intrinsics& k = camera.intrinsics;
  double most = 0;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; j <= kSteps; ++j) {
      const Eigen::Vector2d pixel(
          camera.image_size_px.width * (static_cast<double>(i) / kSteps) - 0.5,
          camera.image_size_px.height * (static_cast<double>(j) / kSteps) - 0.5);
      const absl::StatusOr<Eigen::Vector2d> ray = Undistort(k, pixel);
      if (!ray.ok()) return std::numeric_limits<double>::infinity();
      const Eigen::Vector2d straight(k.fx_px * ray->x() + k.cx_px, k.fy_px * ray->y() + k.cy_px);
      most = std::max(most, (straight - pixel).norm());
    }
  }
  return most;
}

absl::Status CheckNoDistortion(const ExportedCamera& camera, const char* program) {
  const std::string none = absl::StrCat(program, "'s cameras have no lens distortion, and ");
  constexpr char kInstead[] = "; undistort the images, and export undistorted (--undistorted)";
  if (camera.intrinsics.model == DistortionModel::kFisheye) {
    return CannotHold(camera, absl::StrCat(none, "this one is a fisheye", kInstead));
  }
  const double shift_px = LensShiftPx(camera);
  if (shift_px <= kHeldWithinPx) return absl::OkStatus();
  const std::string how_far = std::isfinite(shift_px)
                                  ? absl::StrFormat("moves points by up to %.2f px", shift_px)
                                  : "is known in a part of the image only";
  return CannotHold(camera, absl::StrCat(none, "that of this one ", how_far, kInstead));
}

}  // namespace rigcal

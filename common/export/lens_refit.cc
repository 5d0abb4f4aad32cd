// SPDX-License-Identifier: Apache-2.0
#include "common/export/lens_refit.h"

#include <algorithm>
#include <limits>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/camera/camera_model.h"
#include "common/camera/fit_intrinsics.h"
#include "common/export/lens_shift.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

constexpr Eigen::Index kFocalX = 0, kFocalY = 1, kCoefficients = 4;
constexpr int kRadtanCoefficients = 4;

// The model in the range, and how its values depend on those that are free: values = basis * free.
struct RefitTarget {
  DistortionModel model = DistortionModel::kBrownConrady;
  Eigen::MatrixXd basis;
};

bool IsInRange(LensRange range, const ExportedCamera& camera) {
  const Intrinsics& k = camera.intrinsics;
  const bool rational = k.model == DistortionModel::kRational;
  switch (range) {
    case LensRange::kAll:
      return true;
    case LensRange::kRadtan:
      return !rational &&
             (k.model == DistortionModel::kFisheye || camera.Coefficients().back() == 0);
    case LensRange::kNoRational:
      return !rational;
    case LensRange::kOneFocal:
      return !rational && SingleFocalErrorPx(camera) <= kHeldWithinPx;
    case LensRange::kPinhole:
      return k.model != DistortionModel::kFisheye && LensShiftPx(camera) <= kHeldWithinPx;
  }
  return true;
}

RefitTarget TargetIn(LensRange range, const Intrinsics& k) {
  RefitTarget target;
  const bool fisheye = k.model == DistortionModel::kFisheye && range != LensRange::kPinhole;
  target.model = fisheye ? DistortionModel::kFisheye : DistortionModel::kBrownConrady;
  const Eigen::Index size = IntrinsicsSize(target.model);
  Eigen::Index count = size - kCoefficients;
  if (range == LensRange::kPinhole) count = 0;
  if (range == LensRange::kRadtan) count = kRadtanCoefficients;
  target.basis = Eigen::MatrixXd::Identity(size, kCoefficients + count);
  if (range == LensRange::kOneFocal) {
    target.basis = Eigen::MatrixXd::Zero(size, kCoefficients + count - 1);
    target.basis(kFocalX, 0) = target.basis(kFocalY, 0) = 1;
    target.basis.bottomRightCorner(size - 2, kCoefficients + count - 2).setIdentity();
  }
  return target;
}

// What the image shows on a grid with its corners. Empty: the lens is not known in all of it.
std::vector<RayPixel> RaysOverImage(const ExportedCamera& camera) {
  constexpr int kSteps = 32;
  std::vector<RayPixel> rays;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; j <= kSteps; ++j) {
      const Eigen::Vector2d pixel(
          camera.image_size_px.width * (static_cast<double>(i) / kSteps) - 0.5,
          camera.image_size_px.height * (static_cast<double>(j) / kSteps) - 0.5);
      const absl::StatusOr<Eigen::Vector2d> ray = Undistort(camera.intrinsics, pixel);
      if (!ray.ok()) return {};
      rays.push_back({ray->homogeneous(), pixel});
    }
  }
  return rays;
}

double LargestErrorPx(const Intrinsics& intrinsics, const std::vector<RayPixel>& rays) {
  double largest = 0;
  for (const RayPixel& ray : rays) {
    Eigen::Vector2d pixel;
    if (!Project(intrinsics, ray.direction, &pixel)) {
      return std::numeric_limits<double>::infinity();
    }
    largest = std::max(largest, (pixel - ray.pixel).norm());
  }
  return largest;
}

absl::Status RefitLens(LensRange range, const char* program, double max_error_px,
                       ExportedCamera* camera) {
  constexpr char kOtherWay[] =
      "undistort the images and export with --undistorted, or allow more with --max-error-px";
  const std::vector<RayPixel> rays = RaysOverImage(*camera);
  if (rays.empty()) {
    return CannotHold(*camera, absl::StrCat("its lens is known in a part of the image only, so "
                                            "that none of ",
                                            program, "'s can be fitted to it; ", kOtherWay));
  }
  const RefitTarget target = TargetIn(range, camera->intrinsics);
  const absl::StatusOr<IntrinsicsFit> fit =
      FitIntrinsics(target.model, rays, camera->intrinsics, target.basis);
  const double error_px =
      fit.ok() ? LargestErrorPx(fit->intrinsics, rays) : std::numeric_limits<double>::infinity();
  if (!(error_px <= max_error_px)) {
    return CannotHold(
        *camera, std::isfinite(error_px)
                     ? absl::StrFormat("the nearest lens that %s has shows the image wrong by up "
                                       "to %.3g px, more than %g px; %s",
                                       program, error_px, max_error_px, kOtherWay)
                     : absl::StrCat(program, " has no lens that is near this one; ", kOtherWay));
  }
  camera->intrinsics = fit->intrinsics;
  camera->refit_error_px = error_px;
  return absl::OkStatus();
}

}  // namespace

absl::Status RefitLenses(LensRange range, const char* program, double max_error_px,
                         ExportedRig* rig) {
  for (ExportedCamera& camera : rig->cameras) {
    if (IsInRange(range, camera)) continue;
    RIGCAL_RETURN_IF_ERROR(RefitLens(range, program, max_error_px, &camera));
  }
  return absl::OkStatus();
}

}  // namespace rigcal

// SPDX-License-Identifier: Apache-2.0
#include "common/import/fitted_lens.h"

#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/camera/camera_model.h"
#include "common/camera/fit_intrinsics.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

constexpr int kFitGrid = 32;  // steps along each side of the image
constexpr int kJudgeGrid = 2 * kFitGrid;

constexpr char kMakeAnew[] = "make the camera's lens anew from a board: rigcal-agent intrinsics";

std::string PixelText(const Eigen::Vector2d& pixel) {
  return absl::StrFormat("(%.1f, %.1f)", pixel.x(), pixel.y());
}

// Pixels of a grid over the image with its border, and where the lens looks there.
absl::StatusOr<std::vector<RayPixel>> RaysOfGrid(const ImageSize& size, const RayOfPixel& lens,
                                                 int steps) {
  std::vector<RayPixel> rays;
  int beyond = 0;
  Eigen::Vector2d first_beyond;
  for (int j = 0; j <= steps; ++j) {
    for (int i = 0; i <= steps; ++i) {
      const Eigen::Vector2d pixel(size.width * (static_cast<double>(i) / steps) - 0.5,
                                  size.height * (static_cast<double>(j) / steps) - 0.5);
      const std::optional<Eigen::Vector3d> ray = lens(pixel);
      if (ray && ray->z() > 0) {
        rays.push_back({*ray, pixel});
      } else if (beyond++ == 0) {
        first_beyond = pixel;
      }
    }
  }
  if (beyond == 0) return rays;
  return absl::FailedPreconditionError(absl::StrFormat(
      "shows directions of 90 degrees from its axis and more, or none, in %.0f %% of the image, as "
      "at pixel %s; no lens of rigcal reaches so far",
      100.0 * beyond / ((steps + 1) * (steps + 1)), PixelText(first_beyond)));
}

}  // namespace

absl::StatusOr<FittedLens> FitLens(DistortionModel model, const ImageSize& image_size_px,
                                   const RayOfPixel& lens, const Intrinsics& start) {
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<RayPixel> judged,
                          RaysOfGrid(image_size_px, lens, kJudgeGrid));
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<RayPixel> rays,
                          RaysOfGrid(image_size_px, lens, kFitGrid));
  FittedLens fitted;
  const absl::StatusOr<IntrinsicsFit> fit = FitIntrinsics(model, rays, start);
  if (!fit.ok()) {
    fitted.rms_px = fitted.largest_px = std::numeric_limits<double>::infinity();
    return fitted;
  }
  fitted.intrinsics = fit->intrinsics;
  fitted.rms_px = fit->rms_px;
  for (const RayPixel& ray : judged) {
    Eigen::Vector2d pixel;
    // What is seen twice is no lens, however near one of the two is.
    const bool is_seen = Project(fitted.intrinsics, ray.direction, &pixel) &&
                         Undistort(fitted.intrinsics, ray.pixel).ok();
    const double distance_px =
        is_seen ? (pixel - ray.pixel).norm() : std::numeric_limits<double>::infinity();
    if (!(distance_px > fitted.largest_px)) continue;
    fitted.largest_px = distance_px;
    fitted.largest_at_px = ray.pixel;
  }
  return fitted;
}

absl::StatusOr<FittedLens> FitDoubleSphere(const DoubleSphere& lens,
                                           const ImageSize& image_size_px) {
  if (const absl::Status valid = lens.Validate(); !valid.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat("has a double sphere lens (ds) that is none: ", std::string(valid.message())));
  }
  const auto ray_of = [&lens](const Eigen::Vector2d& pixel) { return lens.Ray(pixel); };
  // Near the axis both spheres are points: u = fx x / ((1 + xi) z).
  const Intrinsics start{.model = DistortionModel::kFisheye,
                         .fx_px = lens.fx_px / (1 + lens.xi),
                         .fy_px = lens.fy_px / (1 + lens.xi),
                         .cx_px = lens.cx_px,
                         .cy_px = lens.cy_px,
                         .distortion = std::vector<double>(4, 0.0)};
  FittedLens best;
  best.largest_px = std::numeric_limits<double>::infinity();
  for (const DistortionModel model : {DistortionModel::kFisheye, DistortionModel::kRational}) {
    absl::StatusOr<FittedLens> fitted = FitLens(model, image_size_px, ray_of, start);
    if (!fitted.ok()) {
      return absl::FailedPreconditionError(absl::StrCat("has a double sphere lens (ds), which ",
                                                        std::string(fitted.status().message())));
    }
    if (fitted->largest_px < best.largest_px) best = *std::move(fitted);
    if (best.largest_px <= kDoubleSphereWithinPx) return best;
  }
  return absl::FailedPreconditionError(
      std::isfinite(best.largest_px)
          ? absl::StrFormat(
                "has a double sphere lens (ds), and the nearest lens of rigcal (%s) is off by %.2f "
                "px at pixel %s, more than %g px; %s",
                std::string(DistortionModelName(best.intrinsics.model)), best.largest_px,
                PixelText(best.largest_at_px), kDoubleSphereWithinPx, kMakeAnew)
          : absl::StrCat("has a double sphere lens (ds), which is near to none of rigcal's; ",
                         kMakeAnew));
}

std::string DoubleSphereNote(const std::string& camera, const FittedLens& fitted) {
  return absl::StrFormat(
      "%s: its double sphere lens is read as the nearest lens of rigcal (%s); they differ by at "
      "most %.2g px, at pixel %s",
      camera, std::string(DistortionModelName(fitted.intrinsics.model)), fitted.largest_px,
      PixelText(fitted.largest_at_px));
}

std::string UnreadableLensModel(const std::string& word) {
  constexpr std::array<std::pair<const char*, const char*>, 6> kModels = {{
      {"eucm", "the extended unified camera model (EUCM)"},
      {"ucm", "the unified camera model (UCM)"},
      {"omni", "the omnidirectional unified camera model (omni, Mei)"},
      {"mei", "the omnidirectional unified camera model (omni, Mei)"},
      {"fov", "the field-of-view model (FOV)"},
      {"ftheta", "the f-theta model"},
  }};
  for (const auto& [known, name] : kModels) {
    if (word == known) {
      return absl::StrCat(name, ", which rigcal does not read; ", kMakeAnew,
                          ", or calibrate with a pinhole or double sphere lens");
    }
  }
  return "";
}

}  // namespace rigcal

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/camera/intrinsics.h"
#include "common/import/double_sphere.h"

namespace rigcal {

// The lens of a file that rigcal has no model of: the direction in frame `cam`, of any length, that
// a pixel looks along; none where the file's lens shows nothing.
using RayOfPixel = std::function<std::optional<Eigen::Vector3d>(const Eigen::Vector2d& pixel)>;

// A lens of rigcal that stands for it, and how far they are apart over the image, border and
// corners included.
struct FittedLens {
  Intrinsics intrinsics;
  double rms_px = 0;
  double largest_px = 0;
  Eigen::Vector2d largest_at_px = Eigen::Vector2d::Zero();  // the pixel where they differ most
};

// The lens of `model` that is nearest to `lens` over the whole image (FitIntrinsics, from `start`,
// on a grid), judged on a grid of twice as many lines; both errors are infinite where no lens of
// the model is near. FAILED_PRECONDITION, with the share of the image and a pixel: some have no
// ray, or one at 90 degrees from the axis and more, which no lens of rigcal has. The message begins
// with a verb.
absl::StatusOr<FittedLens> FitLens(DistortionModel model, const ImageSize& image_size_px,
                                   const RayOfPixel& lens, const Intrinsics& start);

// A double sphere lens as a fisheye lens or, where that is not within kDoubleSphereWithinPx
// everywhere, a rational one. INVALID_ARGUMENT: its values are none of such a lens.
// FAILED_PRECONDITION: as above, or neither is near enough: by how many pixels, and where. Messages
// begin with a verb.
inline constexpr double kDoubleSphereWithinPx = 0.1;
absl::StatusOr<FittedLens> FitDoubleSphere(const DoubleSphere& lens,
                                           const ImageSize& image_size_px);

// For people, of a camera that was read so: as what, and how exact.
std::string DoubleSphereNote(const std::string& camera, const FittedLens& fitted);

// What is said of a lens model that rigcal does not read but knows, `word` of the file: its name
// and what to do. Empty: it is none of those.
std::string UnreadableLensModel(const std::string& word);

}  // namespace rigcal

// SPDX-License-Identifier: Apache-2.0
#include "common/camera/intrinsics.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>

#include "absl/strings/str_cat.h"
#include "common/status/fault_list.h"

namespace rigcal {
namespace {

struct ModelKind {
  std::string_view name;
  int coefficient_count;
};

ModelKind KindOf(DistortionModel model) {
  switch (model) {
    case DistortionModel::kBrownConrady:
      return {"plumb_bob", 5};
    case DistortionModel::kRational:
      return {"rational_polynomial", 8};
    case DistortionModel::kFisheye:
      return {"equidistant", 4};
  }
  return {"unknown", 0};
}

void CheckFocalLength(const char* name, double value, FaultList* faults) {
  if (!(std::isfinite(value) && value > 0)) {
    faults->Add(name, " is ", value, ", it must be finite and positive");
  }
}

void CheckPrincipalPoint(const char* name, double value, double image_side, FaultList* faults) {
  if (!std::isfinite(value)) {
    faults->Add(name, " is ", value, ", it must be finite");
  } else if (image_side > 0 && (value < -image_side || value > 2 * image_side)) {
    faults->Add(name, " is ", value, " in an image of ", image_side,
                " px, further outside than the image is large");
  }
}

// As of normalised image coordinates: a focal length and a centre that no real image has in pixels.
bool IsInShares(const Intrinsics& intrinsics, const ImageSize& image_size) {
  constexpr double kLeastSidePx = 50, kMostFocal = 4, kMostCentre = 1.5;
  return std::min(image_size.width, image_size.height) >= kLeastSidePx &&
         std::max(intrinsics.fx_px, intrinsics.fy_px) <= kMostFocal &&
         std::max(std::abs(intrinsics.cx_px), std::abs(intrinsics.cy_px)) <= kMostCentre;
}

}  // namespace

int CoefficientCount(DistortionModel model) { return KindOf(model).coefficient_count; }

std::string_view DistortionModelName(DistortionModel model) { return KindOf(model).name; }

absl::Status ImageSize::Validate() const {
  if (width >= 1 && width <= kMaxImageSidePx && height >= 1 && height <= kMaxImageSidePx) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrCat("image size is ", width, " x ", height,
                                                 " px, each side must be 1 to ", kMaxImageSidePx));
}

absl::Status Intrinsics::Validate(const ImageSize& image_size) const {
  FaultList faults;
  CheckFocalLength("fx_px", fx_px, &faults);
  CheckFocalLength("fy_px", fy_px, &faults);
  CheckPrincipalPoint("cx_px", cx_px, image_size.width, &faults);
  CheckPrincipalPoint("cy_px", cy_px, image_size.height, &faults);
  if (faults.Result().ok() && IsInShares(*this, image_size)) {
    faults.Add("focal lengths ", fx_px, " and ", fy_px, " and centre (", cx_px, ", ", cy_px,
               ") are shares of the image, not pixels: multiply fx and cx by its width and fy and "
               "cy by its height (",
               image_size.width, ", ", image_size.height, "), or all by what they were divided by");
  }
  const size_t count = static_cast<size_t>(CoefficientCount(model));
  if (count == 0) {
    faults.Add("distortion model ", static_cast<int>(model), " is unknown");
  } else if (!distortion.empty() && distortion.size() != count) {
    faults.Add(std::string(DistortionModelName(model)), " has ", count,
               " distortion coefficients (or none), not ", distortion.size());
  }
  for (size_t i = 0; i < distortion.size(); ++i) {
    if (!std::isfinite(distortion[i])) {
      faults.Add("distortion[", i, "] is ", distortion[i], ", it must be finite");
    }
  }
  return faults.Result();
}

}  // namespace rigcal

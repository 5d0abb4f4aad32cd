// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "common/camera/distortion_model.h"

namespace rigcal {

inline constexpr uint32_t kMaxImageSidePx = 65536;

struct ImageSize {
  uint32_t width = 0;
  uint32_t height = 0;
  friend bool operator==(const ImageSize&, const ImageSize&) = default;

  // Each side must be 1 to kMaxImageSidePx.
  absl::Status Validate() const;
};

// Pinhole projection with lens distortion. The centre of the first pixel is (0, 0), as in OpenCV.
struct Intrinsics {
  DistortionModel model = DistortionModel::kBrownConrady;
  double fx_px = 0;
  double fy_px = 0;
  double cx_px = 0;
  double cy_px = 0;
  // CoefficientCount(model) values, or none for zero distortion.
  std::vector<double> distortion;

  friend bool operator==(const Intrinsics&, const Intrinsics&) = default;

  // Every fault: focal lengths not positive, values not finite, wrong number of coefficients, or a
  // principal point further outside the image than the image is large (not looked at for a side of
  // 0 px: size not known).
  absl::Status Validate(const ImageSize& image_size) const;
};

}  // namespace rigcal

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "common/camera/camera_export.h"
#include "common/camera/intrinsics.h"

namespace rigcal {

struct IntrinsicsFile {
  ImageSize image_size_px;
  Intrinsics intrinsics;
};

// Reads an OpenCV FileStorage YAML with image_width, image_height, camera_matrix, distortion_model
// (plumb_bob, rational_polynomial, equidistant; absent: by the number of coefficients, 4 or 5 or 8)
// and distortion_coefficients.
// What the file says of the camera's name or pose is ignored. NOT_FOUND: no such file.
// INVALID_ARGUMENT: names the file, the line where the parser knows it, and the missing or
// malformed field.
absl::StatusOr<IntrinsicsFile> ReadIntrinsicsFile(const std::string& path);

}  // namespace rigcal

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
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

// The same with the pose that an exported file has.
struct CameraFile {
  std::string camera;  // the file's name without its end; camera_name often is another
  IntrinsicsFile lens;
  std::optional<Eigen::Matrix4d> extrinsics;  // 4x4 or 3x4 in the file; none: no such field
};
// The errors of ReadIntrinsicsFile; a malformed matrix is one, too.
absl::StatusOr<CameraFile> ReadCameraFile(const std::string& path);

// The fields of an OpenCV YAML text as one document, on the same lines as in `text`. OpenCV's
// parser overflows the stack on deep nesting, and turns for ever in some texts that hold several
// documents or stray signs between fields (4.6), so that only texts of the form it writes itself
// are let through; comments and the marks `---` and `...` are taken out. INVALID_ARGUMENT names
// `path` and the line.
absl::StatusOr<std::string> SingleDocument(const std::string& path, const std::string& text);

}  // namespace rigcal

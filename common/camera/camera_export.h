// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/camera/intrinsics.h"
#include "common/geometry/rigid_transform.h"

namespace rigcal {

// What an exported calibration holds of one camera.
struct CameraExport {
  std::string camera;
  ImageSize image_size_px;
  Intrinsics intrinsics;
  std::optional<RigidTransform> cam_from_rig = RigidTransform();  // metres; none: the lens alone
  double reprojection_error_px = 0;                               // mean
  double line_delay_s = 0;  // from one image row to the next; 0: none is known
};

// An OpenCV FileStorage YAML with the fields of the eWand result: camera_name, image_width,
// image_height, camera_matrix, distortion_model, distortion_coefficients, extrinsics (4x4
// cam_from_rig, metres) and reprojection_error; of a rolling shutter also line_delay, in seconds
// from one image row to the next. INVALID_ARGUMENT names the camera and every value that is not
// finite or out of range.
absl::StatusOr<std::string> CameraExportText(const CameraExport& camera);

// Writes that text. Replaces the file whole or not at all.
absl::Status WriteCameraExport(const std::string& path, const CameraExport& camera);

}  // namespace rigcal

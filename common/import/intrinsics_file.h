// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "common/camera/intrinsics.h"

namespace rigcal {

struct IntrinsicsFile {
  ImageSize image_size_px;
  Intrinsics intrinsics;
};

// The lens of one camera from any file that ReadCalibrationFile reads: OpenCV's YAML, XML or JSON,
// ROS's camera_info, kalibr's camchain, ... Its pose is ignored. Of a file with several cameras it
// is that of `camera`, or without a name that of the camera which is called like the file.
// NOT_FOUND: no such file. INVALID_ARGUMENT: names the file, the line where it is known, and the
// missing or malformed field; or the cameras that the file has.
absl::StatusOr<IntrinsicsFile> ReadIntrinsicsFile(const std::string& path,
                                                  const std::string& camera = "");

// The file with the lens of the camera that recorded `recording`, beside it: "left.yaml" of
// "left.csv", else another of the endings below, or "left.camera_info.yaml". Where there is none,
// the first of these names.
std::string LensFileBeside(const std::string& recording);

// Whether the file is called like one that may hold a lens: .yaml, .yml, .xml, .json, in capitals,
// too.
bool IsLensFileName(const std::string& path);

}  // namespace rigcal

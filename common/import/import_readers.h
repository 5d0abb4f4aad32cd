// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "common/import/imported_rig.h"

namespace rigcal {

// One reader per format, each in a file of its own: xyz_import.cc. `path` is for messages.
// INVALID_ARGUMENT names the file, the line where it is known, and the fault.

// OpenCV FileStorage YAML with `extrinsics` (4x4 cam_from_rig, metres), one file per camera.
absl::StatusOr<ImportedCamera> ReadOpenCvCamera(const std::string& path);

absl::StatusOr<ImportedRig> ReadKalibr(const std::string& path, const std::string& text);

// caliscope's camera_array.toml and anipose's calibration.toml, which have the same fields.
absl::StatusOr<ImportedRig> ReadCaliscope(const std::string& path, const std::string& text);

// Qualisys' .qca.txt, and Theia's calibration files, which are written alike with poses of another
// convention.
absl::StatusOr<ImportedRig> ReadQtm(const std::string& path, const std::string& text);

// Vicon's .xcp. Its lens model takes pixels to pixels without distortion; ours is fitted to it.
absl::StatusOr<ImportedRig> ReadVicon(const std::string& path, const std::string& text);

// A file, or a folder of OpenCV files, of the format that its content says. NOT_FOUND: no such
// file.
absl::StatusOr<ImportedRig> ReadCalibrationFile(const std::string& path);

}  // namespace rigcal

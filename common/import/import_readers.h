// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "absl/status/statusor.h"
#include "common/import/imported_rig.h"
#include "common/import/lens_tree.h"

namespace rigcal {

// One reader per format, each in a file of its own: xyz_import.cc. `path` is for messages.
// INVALID_ARGUMENT names the file, the line where it is known, and the fault.

// OpenCV's YAML, XML or JSON (cv::FileStorage) with `extrinsics` (4x4 cam_from_rig, metres), and
// ROS's camera_info, one file per camera, which is called like the file. `root`: its fields.
absl::StatusOr<ImportedCamera> LensCameraOf(const std::string& path, const LensNode& root);

// Static transforms of a ROS launch file (tf2_ros, ROS 1 and 2): gives the cameras of `rig` without
// a pose that of their frame, NAME or NAME_optical_frame.
absl::Status AddRosTransforms(const std::string& path, const std::string& text, ImportedRig* rig);

// A COLMAP model, as text or binary: the folder with its files cameras and images.
bool IsColmapFolder(const std::filesystem::path& folder);
absl::StatusOr<ImportedRig> ReadColmap(const std::filesystem::path& folder);

// nerfstudio's transforms.json and OpenMVG's sfm_data.json.
absl::StatusOr<ImportedRig> ReadNerfstudio(const std::string& path, const std::string& text);
absl::StatusOr<ImportedRig> ReadOpenMvg(const std::string& path, const std::string& text);

// Basalt's calibration.json. Its double sphere lenses are fitted (FitDoubleSphere).
absl::StatusOr<ImportedRig> ReadBasalt(const std::string& path, const std::string& text);

// mrcal's .cameramodel of one camera, which is called like the file.
absl::StatusOr<ImportedRig> ReadMrcal(const std::string& path, const std::string& text);

// kalibr's camchain. Its double sphere lenses are fitted (FitDoubleSphere).
absl::StatusOr<ImportedRig> ReadKalibr(const std::string& path, const std::string& text);

// caliscope's camera_array.toml and anipose's calibration.toml, which have the same fields.
absl::StatusOr<ImportedRig> ReadCaliscope(const std::string& path, const std::string& text);

// Qualisys' .qca.txt, and Theia's calibration files, which are written alike with poses of another
// convention.
absl::StatusOr<ImportedRig> ReadQtm(const std::string& path, const std::string& text);

// Vicon's .xcp. Its lens model takes pixels to pixels without distortion; ours is fitted to it.
absl::StatusOr<ImportedRig> ReadVicon(const std::string& path, const std::string& text);

// A file, or a folder of OpenCV or ROS files or of a COLMAP model, of the format that its content
// says. NOT_FOUND: no such file.
absl::StatusOr<ImportedRig> ReadCalibrationFile(const std::string& path);

// All of a file, without a byte-order mark. PERMISSION_DENIED, DATA_LOSS; INVALID_ARGUMENT: it is
// larger.
absl::StatusOr<std::string> ReadImportText(const std::string& path,
                                           size_t most_bytes = size_t{4} << 20);

}  // namespace rigcal

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/camera/intrinsics.h"
#include "common/geometry/rigid_transform.h"
#include "common/text/nesting.h"

namespace rigcal {

// A camera of another program's calibration, in our units, axes and pixel origin.
struct ImportedCamera {
  std::string name;
  ImageSize image_size_px;
  Intrinsics intrinsics;
  std::optional<RigidTransform> cam_from_rig;  // metres; none: the file has no pose of it
  double time_offset_s = 0;                    // rig_time = camera_time + time_offset
  std::string other_name = {};                 // what else the file calls it: kalibr's "cam0"
};

// A camera of a file that cannot be taken from it.
struct LeftOutCamera {
  std::string name;  // as in the file
  std::string why;   // with file and line
};

struct ImportedRig {
  std::string format;  // for people: "kalibr"
  std::vector<ImportedCamera> cameras;
  // What somebody who uses the result has to know: a convention that was recognised by projecting,
  // a lens that had to be fitted.
  std::vector<std::string> notes;
  // What one camera lacks costs no other one.
  std::vector<LeftOutCamera> left_out = {};
  // Notes on cameras that are read, but perhaps not as the file means them.
  std::vector<std::string> doubts = {};

  // The camera, or why it is left out.
  void Add(const std::string& name, absl::StatusOr<ImportedCamera> camera);
};

// "PATH, line 12: WHY", or without a line where it is 0. INVALID_ARGUMENT.
absl::Status ImportError(const std::string& path, int line, const std::string& why);

// INVALID_ARGUMENT: control characters, with which parsers of texts cannot be trusted.
absl::Status CheckText(const std::string& path, const std::string& text);

// The same, and INVALID_ARGUMENT for a text that nests deeper than its parser survives.
absl::Status CheckText(const std::string& path, const std::string& text, NestedFormat format);

// The rotation that a file's matrix says. INVALID_ARGUMENT: not finite, not a rotation, or
// mirrored; the message has no place in it.
absl::StatusOr<Eigen::Quaterniond> RotationFrom(const Eigen::Matrix3d& matrix);

// Every fault of a camera's values, at this place of the file. INVALID_ARGUMENT.
absl::Status CheckImported(const std::string& path, int line, const ImportedCamera& camera);

// INVALID_ARGUMENT: two cameras of one name, or none at all; if all were left out, why the first
// one was.
absl::Status CheckNames(const std::string& path, const ImportedRig& rig);

// A name of a camera made of what a file calls it: letters that no name of ours has become '_'.
std::string CameraNameFrom(std::string text);

}  // namespace rigcal

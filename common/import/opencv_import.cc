// SPDX-License-Identifier: Apache-2.0
#include "common/camera/intrinsics_file.h"
#include "common/import/import_readers.h"
#include "common/status/status_macros.h"

namespace rigcal {

absl::StatusOr<ImportedCamera> ReadOpenCvCamera(const std::string& path) {
  RIGCAL_ASSIGN_OR_RETURN(const CameraFile file, ReadCameraFile(path));
  ImportedCamera camera;
  camera.name = file.camera;
  camera.image_size_px = file.lens.image_size_px;
  camera.intrinsics = file.lens.intrinsics;
  if (file.extrinsics) {
    const Eigen::Matrix4d& pose = *file.extrinsics;
    const absl::StatusOr<Eigen::Quaterniond> rotation = RotationFrom(pose.topLeftCorner<3, 3>());
    if (!rotation.ok()) {
      return ImportError(path, 0, "extrinsics: " + std::string(rotation.status().message()));
    }
    camera.cam_from_rig = RigidTransform(*rotation, pose.topRightCorner<3, 1>());
  }
  RIGCAL_RETURN_IF_ERROR(CheckImported(path, 0, camera));
  return camera;
}

}  // namespace rigcal

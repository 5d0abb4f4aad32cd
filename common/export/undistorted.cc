// SPDX-License-Identifier: Apache-2.0
#include "common/export/undistorted.h"

#include <algorithm>

#include "common/camera/distortion_model.h"
#include "common/camera/intrinsics.h"
#include "common/wire/camera_wire.h"

namespace rigcal {

v1::Calibration Undistorted(v1::Calibration calibration) {
  for (v1::CalibratedCamera& camera : *calibration.mutable_cameras()) {
    // What cannot be read is left for the writers to refuse.
    absl::StatusOr<Intrinsics> intrinsics = wire::FromProto(camera.intrinsics());
    if (!intrinsics.ok()) continue;
    intrinsics->model = DistortionModel::kBrownConrady;
    intrinsics->distortion.clear();
    *camera.mutable_intrinsics() = wire::ToProto(*intrinsics);
    if (!camera.has_uncertainty()) continue;
    auto& sigma = *camera.mutable_uncertainty()->mutable_intrinsics_sigma();
    sigma.Truncate(std::min(sigma.size(), 4));  // fx fy cx cy
  }
  return calibration;
}

}  // namespace rigcal

// SPDX-License-Identifier: Apache-2.0
#include "tests/common/export/exported_rigs.h"

#include "common/wire/camera_wire.h"

namespace rigcal::testing {
namespace {

Intrinsics IntrinsicsOf(TestLens lens, const ImageSize& size, bool square) {
  Intrinsics k;
  k.fx_px = 0.9 * size.width;
  k.fy_px = square ? k.fx_px : 1.01 * k.fx_px;
  k.cx_px = 0.51 * size.width;
  k.cy_px = 0.48 * size.height;
  switch (lens) {
    case TestLens::kPinhole:
      break;
    case TestLens::kBrown4:
      k.distortion = {-0.12, 0.03, 0.0011, -0.0007, 0};
      break;
    case TestLens::kBrown5:
      k.distortion = {-0.12, 0.03, 0.0011, -0.0007, -0.004};
      break;
    case TestLens::kRational:
      k.model = DistortionModel::kRational;
      k.distortion = {0.3, 0.05, -0.0006, 0.0009, 0.002, 0.42, 0.08, 0.004};
      break;
    case TestLens::kFisheye:
      k.model = DistortionModel::kFisheye;
      k.fx_px *= 0.45;
      k.fy_px *= 0.45;
      k.distortion = {0.02, -0.006, 0.002, -0.0004};
      break;
  }
  return k;
}

}  // namespace

v1::Calibration CalibrationOfLens(TestLens lens, const std::vector<std::string>& names,
                                  bool square) {
  v1::Calibration calibration;
  calibration.set_id("c-000042");
  calibration.set_state(v1::Calibration::STATE_SUCCEEDED);
  calibration.set_scale_known(true);
  calibration.mutable_run()->mutable_create_time()->set_seconds(1'700'000'000);
  int index = 0;
  for (const std::string& name : names) {
    v1::CalibratedCamera* const camera = calibration.add_cameras();
    camera->set_camera(name);
    const ImageSize size{1280u + 64u * static_cast<uint32_t>(index), index % 2 == 0 ? 1024u : 720u};
    *camera->mutable_image_size_px() = wire::ToProto(size);
    *camera->mutable_intrinsics() = wire::ToProto(IntrinsicsOf(lens, size, square));
    const Eigen::Vector3d axis = Eigen::Vector3d(0.3, 1, -0.2 * index).normalized();
    *camera->mutable_cam_from_rig() =
        wire::ToProto(RigidTransform(Eigen::Quaterniond(Eigen::AngleAxisd(0.8 * index, axis)),
                                     Eigen::Vector3d(0.4 * index, -0.25 * index, 1.5 * index)));
    camera->set_time_offset_s(0.002 * index);
    camera->mutable_residuals()->mutable_all()->set_mean_px(0.25);
    ++index;
  }
  return calibration;
}

}  // namespace rigcal::testing

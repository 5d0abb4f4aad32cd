// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/rig/calibration_errors.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "common/statistics/robust_statistics.h"
#include "tests/accuracy/rig/statistics.h"

namespace rigcal::accuracy {
namespace {

std::vector<double> Values(const Intrinsics& intrinsics) {
  std::vector<double> values = {intrinsics.fx_px, intrinsics.fy_px, intrinsics.cx_px,
                                intrinsics.cy_px};
  values.insert(values.end(), intrinsics.distortion.begin(), intrinsics.distortion.end());
  return values;
}

std::vector<double> Difference(const std::vector<double>& a, const std::vector<double>& b) {
  std::vector<double> difference;
  for (size_t i = 0; i < a.size() && i < b.size(); ++i) difference.push_back(a[i] - b[i]);
  return difference;
}

// rig_time = raw - origin + offset + rate * (raw - origin), written around the epoch in raw time.
// Origins are hours: the part common to result and ground truth is subtracted before it costs
// digits.
double TrueOffsetAtEpoch(const SimulatedCamera& camera, double time_epoch_s) {
  const double origin_s = 1e-9 * static_cast<double>(camera.clock_origin_ns);
  return -origin_s + camera.time_offset_s + 1e-6 * camera.time_rate_ppm * (time_epoch_s - origin_s);
}

void SubtractTrueClocks(const SimulatedWorld& world, const CalibrationResult& result,
                        CalibrationErrors* errors) {
  std::vector<double> offset, rate, true_offset, true_rate;
  for (size_t i = 0; i < result.cameras.size(); ++i) {
    const SimulatedCamera& camera = world.cameras()[static_cast<size_t>(errors->cameras[i].index)];
    offset.push_back(result.cameras[i].time_offset_s);
    rate.push_back(result.cameras[i].time_rate_ppm);
    true_offset.push_back(TrueOffsetAtEpoch(camera, result.cameras[i].time_epoch_s));
    true_rate.push_back(camera.time_rate_ppm);
  }
  for (size_t i = 0; i < offset.size(); ++i) {
    errors->cameras[i].time_offset_s =
        (offset[i] - Median(offset)) - (true_offset[i] - Median(true_offset));
    errors->cameras[i].line_delay_s =
        result.cameras[i].line_delay_s -
        world.cameras()[static_cast<size_t>(errors->cameras[i].index)].line_delay_s;
    errors->cameras[i].time_rate_ppm =
        (rate[i] - Median(rate)) - (true_rate[i] - Median(true_rate));
  }
}

void TakeOutScale(CalibrationErrors* errors) {
  double along = 0, size = 0;
  for (const CameraError& camera : errors->cameras) {
    along += camera.true_position_m.dot(camera.pose.position_m);
    size += camera.true_position_m.squaredNorm();
  }
  errors->scale_rel = along / size;
  for (const CameraError& camera : errors->cameras) {
    errors->shape_m.push_back(camera.pose.position_m - errors->scale_rel * camera.true_position_m);
  }
}

}  // namespace

Eigen::Vector3d CalibrationErrors::PositionErrorAtTrueLengthM(size_t camera) const {
  const CameraError& error = cameras[camera];
  return error.pose.position_m - target_length_rel * error.true_position_m;
}

double CalibrationErrors::PositionRmsM() const {
  double sum = 0;
  int count = 0;
  for (const CameraError& camera : cameras) {
    if (camera.is_reference) continue;
    sum += camera.pose.position_m.squaredNorm();
    ++count;
  }
  return std::sqrt(sum / count);
}

absl::StatusOr<CalibrationErrors> CompareWithGroundTruth(const SimulatedWorld& world,
                                                         const CalibrationResult& result) {
  CalibrationErrors errors;
  errors.reference = CameraIndex(world, result.reference_camera);
  if (errors.reference < 0 || result.cameras.size() != world.cameras().size()) {
    return absl::InternalError(absl::StrCat("the result has ", result.cameras.size(), " of ",
                                            world.cameras().size(), " cameras, its reference is ",
                                            result.reference_camera));
  }
  RigidTransform cam_from_rig_of_reference;
  for (const CalibratedCamera& camera : result.cameras) {
    if (camera.camera == result.reference_camera) cam_from_rig_of_reference = camera.cam_from_rig;
  }
  for (const CalibratedCamera& camera : result.cameras) {
    CameraError error;
    error.camera = camera.camera;
    error.index = CameraIndex(world, camera.camera);
    if (error.index < 0) return absl::InternalError(absl::StrCat("unknown ", camera.camera));
    error.is_reference = error.index == errors.reference;
    const RigidTransform truth = TruePose(world, error.index, errors.reference);
    error.pose = ErrorOf(camera.cam_from_rig * cam_from_rig_of_reference.Inverse(), truth);
    error.true_position_m = truth.SourceFromTargetTranslation();
    if (camera.intrinsics_refined) {
      error.intrinsics =
          Difference(Values(camera.intrinsics),
                     Values(world.cameras()[static_cast<size_t>(error.index)].true_intrinsics));
    }
    error.sigma = camera.uncertainty;
    errors.cameras.push_back(std::move(error));
  }
  SubtractTrueClocks(world, result, &errors);
  // A rigid target has points instead of positions on a line.
  if (!result.target.marker_positions_m.empty()) {
    errors.marker_positions_m =
        Difference(result.target.marker_positions_m, world.true_target().marker_positions_m);
    errors.marker_positions_m.erase(errors.marker_positions_m.begin());
    errors.target_length_rel =
        result.target.marker_positions_m.back() / world.true_target().marker_positions_m.back() - 1;
  }
  TakeOutScale(&errors);
  return errors;
}

}  // namespace rigcal::accuracy

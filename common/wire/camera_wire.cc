// SPDX-License-Identifier: Apache-2.0
#include "common/wire/camera_wire.h"

#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/board/board.h"
#include "common/status/status_macros.h"

namespace rigcal::wire {
namespace {

// Prefixes a message with the field it was found in.
absl::Status In(absl::string_view field, const absl::Status& status) {
  if (status.ok()) return status;
  return absl::Status(status.code(), absl::StrCat(field, ": ", status.message()));
}

}  // namespace

v1::ImageSize ToProto(const ImageSize& size) {
  v1::ImageSize proto;
  proto.set_width(size.width);
  proto.set_height(size.height);
  return proto;
}

ImageSize FromProto(const v1::ImageSize& proto) { return {proto.width(), proto.height()}; }

v1::Intrinsics ToProto(const Intrinsics& intrinsics) {
  v1::Intrinsics proto;
  proto.set_model(static_cast<v1::Intrinsics::Model>(intrinsics.model));
  proto.set_fx_px(intrinsics.fx_px);
  proto.set_fy_px(intrinsics.fy_px);
  proto.set_cx_px(intrinsics.cx_px);
  proto.set_cy_px(intrinsics.cy_px);
  proto.mutable_distortion()->Assign(intrinsics.distortion.begin(), intrinsics.distortion.end());
  return proto;
}

absl::StatusOr<Intrinsics> FromProto(const v1::Intrinsics& proto) {
  if (!v1::Intrinsics::Model_IsValid(proto.model()) ||
      proto.model() == v1::Intrinsics::MODEL_UNSPECIFIED) {
    return absl::InvalidArgumentError(
        absl::StrCat("model: ", static_cast<int>(proto.model()),
                     " is no distortion model; known are MODEL_BROWN_CONRADY, MODEL_RATIONAL, "
                     "MODEL_FISHEYE"));
  }
  Intrinsics intrinsics;
  intrinsics.model = static_cast<DistortionModel>(proto.model());
  intrinsics.fx_px = proto.fx_px();
  intrinsics.fy_px = proto.fy_px();
  intrinsics.cx_px = proto.cx_px();
  intrinsics.cy_px = proto.cy_px();
  intrinsics.distortion.assign(proto.distortion().begin(), proto.distortion().end());
  return intrinsics;
}

v1::CameraSettings ToProto(const CameraSettings& settings) {
  v1::CameraSettings proto;
  proto.set_model(settings.model);
  proto.set_pixel_format(settings.pixel_format);
  proto.set_exposure_s(settings.exposure_s);
  proto.set_gain_db(settings.gain_db);
  proto.set_frame_rate_hz(settings.frame_rate_hz);
  proto.set_trigger(settings.trigger);
  proto.set_ptp(settings.ptp);
  return proto;
}

CameraSettings FromProto(const v1::CameraSettings& proto) {
  return {proto.model(),         proto.pixel_format(), proto.exposure_s(), proto.gain_db(),
          proto.frame_rate_hz(), proto.trigger(),      proto.ptp()};
}

v1::CameraDescription ToProto(const CameraDescription& camera) {
  v1::CameraDescription proto;
  proto.set_camera(camera.camera);
  *proto.mutable_image_size_px() = ToProto(camera.image_size_px);
  if (camera.intrinsics) *proto.mutable_intrinsics() = ToProto(*camera.intrinsics);
  proto.mutable_clock()->set_clock_id(camera.clock.clock_id);
  proto.mutable_clock()->set_timebase(camera.clock.timebase);
  proto.set_latency_s(camera.latency_s);
  proto.set_sensor(static_cast<v1::CameraDescription::Sensor>(camera.sensor));
  proto.set_source(camera.source);
  if (camera.settings) *proto.mutable_settings() = ToProto(*camera.settings);
  return proto;
}

absl::StatusOr<CameraDescription> FromProto(const v1::CameraDescription& proto) {
  CameraDescription camera;
  camera.camera = proto.camera();
  camera.image_size_px = FromProto(proto.image_size_px());
  if (proto.has_intrinsics()) {
    absl::StatusOr<Intrinsics> intrinsics = FromProto(proto.intrinsics());
    if (!intrinsics.ok()) {
      return In(absl::StrCat("camera ", camera.camera, ": intrinsics"), intrinsics.status());
    }
    camera.intrinsics = *std::move(intrinsics);
  }
  camera.clock = {proto.clock().clock_id(), proto.clock().timebase()};
  camera.latency_s = proto.latency_s();
  if (!v1::CameraDescription::Sensor_IsValid(proto.sensor())) {
    return absl::InvalidArgumentError(absl::StrCat("camera ", camera.camera,
                                                   ": sensor: ", static_cast<int>(proto.sensor()),
                                                   " is not a known kind of sensor"));
  }
  camera.sensor = static_cast<SensorKind>(proto.sensor());
  camera.source = proto.source();
  if (proto.has_settings()) camera.settings = FromProto(proto.settings());
  RIGCAL_RETURN_IF_ERROR(camera.Validate());
  return camera;
}

v1::Vector3 ToProto(const Eigen::Vector3d& vector) {
  v1::Vector3 proto;
  proto.set_x(vector.x());
  proto.set_y(vector.y());
  proto.set_z(vector.z());
  return proto;
}

Eigen::Vector3d FromProto(const v1::Vector3& proto) { return {proto.x(), proto.y(), proto.z()}; }

v1::RigidTransform ToProto(const RigidTransform& transform) {
  v1::RigidTransform proto;
  const Eigen::Quaterniond rotation = Canonical(transform.rotation);
  proto.mutable_rotation()->set_w(rotation.w());
  proto.mutable_rotation()->set_x(rotation.x());
  proto.mutable_rotation()->set_y(rotation.y());
  proto.mutable_rotation()->set_z(rotation.z());
  *proto.mutable_translation_m() = ToProto(transform.translation_m);
  return proto;
}

absl::StatusOr<RigidTransform> FromProto(const v1::RigidTransform& proto) {
  const Eigen::Quaterniond rotation(proto.rotation().w(), proto.rotation().x(),
                                    proto.rotation().y(), proto.rotation().z());
  // Bits are kept as they came: a stored calibration must read back equal.
  if (!(std::abs(rotation.norm() - 1) < 1e-6)) {
    return absl::InvalidArgumentError("rotation: not a unit quaternion");
  }
  const Eigen::Vector3d translation_m = FromProto(proto.translation_m());
  if (!translation_m.allFinite()) {
    return absl::InvalidArgumentError("translation_m: not finite");
  }
  return RigidTransform(rotation, translation_m);
}

v1::Target ToProto(const Target& target) {
  v1::Target proto;
  proto.set_kind(static_cast<v1::Target::Kind>(target.kind));
  proto.mutable_marker_positions_m()->Assign(target.marker_positions_m.begin(),
                                             target.marker_positions_m.end());
  proto.set_diameter_m(target.diameter_m);
  proto.mutable_blink_hz()->Assign(target.blink_hz.begin(), target.blink_hz.end());
  proto.set_span_tolerance_m(target.span_tolerance_m);
  for (const TargetPoint& point : target.points) {
    v1::TargetPoint& added = *proto.add_points();
    added.set_label(point.label);
    added.set_x_m(point.x_m);
    added.set_y_m(point.y_m);
    added.set_z_m(point.z_m);
    added.set_sigma_m(point.sigma_m);
  }
  proto.set_surveyed(target.is_surveyed);
  proto.set_board(target.board);
  return proto;
}

absl::StatusOr<Target> FromProto(const v1::Target& proto) {
  if (proto.kind() != v1::Target::KIND_WAND && proto.kind() != v1::Target::KIND_POINT &&
      proto.kind() != v1::Target::KIND_RIGID && proto.kind() != v1::Target::KIND_STATIC) {
    return absl::InvalidArgumentError(
        "target.kind: must be KIND_WAND, KIND_POINT, KIND_RIGID or KIND_STATIC");
  }
  Target target;
  target.kind = static_cast<TargetKind>(proto.kind());
  target.marker_positions_m.assign(proto.marker_positions_m().begin(),
                                   proto.marker_positions_m().end());
  target.diameter_m = proto.diameter_m();
  target.blink_hz.assign(proto.blink_hz().begin(), proto.blink_hz().end());
  for (const v1::TargetPoint& point : proto.points()) {
    target.points.push_back(
        {point.label(), point.x_m(), point.y_m(), point.z_m(), point.sigma_m()});
  }
  target.is_surveyed = proto.surveyed();
  target.board = proto.board();
  if (!target.board.empty() && target.points.empty()) {
    const absl::StatusOr<Board> board = ParseBoard(target.board);
    absl::StatusOr<Target> meant =
        board.ok() ? MakeBoardTarget(*board) : absl::StatusOr<Target>(board.status());
    RIGCAL_RETURN_IF_ERROR(In("target.board", meant.status()));
    target.board = std::move(meant->board);
    target.points = std::move(meant->points);
  }
  if (proto.span_tolerance_m() != 0) target.span_tolerance_m = proto.span_tolerance_m();
  RIGCAL_RETURN_IF_ERROR(In("target", target.Validate()));
  return target;
}

}  // namespace rigcal::wire

// SPDX-License-Identifier: Apache-2.0
#include "common/wire/frame_wire.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/wire/camera_wire.h"

namespace rigcal::wire {
namespace {

static_assert(static_cast<int>(FrameSource::kFloor) == v1::FRAME_SOURCE_FLOOR);
static_assert(static_cast<int>(FrameSource::kPoints) == v1::FRAME_SOURCE_POINTS);
static_assert(static_cast<int>(FrameSource::kPath) == v1::FRAME_SOURCE_PATH);
static_assert(static_cast<int>(FrameSource::kDown) == v1::FRAME_SOURCE_DOWN);
static_assert(static_cast<int>(FrameSource::kTransform) == v1::FRAME_SOURCE_TRANSFORM);
static_assert(static_cast<int>(FrameSource::kKept) == v1::FRAME_SOURCE_KEPT);
static_assert(static_cast<int>(FrameSource::kNotKept) == v1::FRAME_SOURCE_NOT_KEPT);
static_assert(static_cast<int>(InformationGroup::Kind::kCamera) ==
              v1::InformationGroup::KIND_CAMERA);
static_assert(static_cast<int>(ParameterInformation::Kind::kIntrinsic) ==
              v1::ParameterInformation::KIND_INTRINSIC);

// What is beyond the range of a marker is refused by Validate().
constexpr uint32_t kNoMarker = 1u << 20;

int IndexOf(uint32_t value) { return static_cast<int>(std::min(value, kNoMarker)); }

template <typename Field>
void WriteMeasured(const std::vector<MarkerViews>& measured, Field* field) {
  for (const MarkerViews& marker : measured) {
    v1::MarkerViews* const proto = field->Add();
    proto->set_marker(static_cast<uint32_t>(marker.marker));
    proto->set_place(static_cast<uint32_t>(marker.place));
    proto->set_rig_time_ns(marker.rig_time_ns);
    for (const MarkerView& view : marker.views) {
      v1::MarkerView* const out = proto->add_views();
      out->set_camera(view.camera);
      out->set_x_px(view.x_px);
      out->set_y_px(view.y_px);
      out->set_cov_xx_px2(view.xx_px2);
      out->set_cov_xy_px2(view.xy_px2);
      out->set_cov_yy_px2(view.yy_px2);
    }
  }
}

template <typename Field>
std::vector<MarkerViews> ReadMeasured(const Field& field) {
  std::vector<MarkerViews> measured;
  measured.reserve(static_cast<size_t>(field.size()));
  for (const v1::MarkerViews& proto : field) {
    MarkerViews& marker = measured.emplace_back();
    marker.marker = IndexOf(proto.marker());
    marker.place = IndexOf(proto.place());
    marker.rig_time_ns = proto.rig_time_ns();
    for (const v1::MarkerView& view : proto.views()) {
      marker.views.push_back({view.camera(), view.x_px(), view.y_px(), view.cov_xx_px2(),
                              view.cov_xy_px2(), view.cov_yy_px2()});
    }
  }
  return measured;
}

}  // namespace

v1::OriginOptions ToProto(const OriginRequest& request) {
  v1::OriginOptions proto;
  proto.set_source(static_cast<v1::FrameSource>(request.source));
  proto.set_height_m(request.height_m);
  for (const TargetPoint& point : request.points) {
    v1::KnownPoint* const known = proto.add_points();
    known->set_label(point.label);
    *known->mutable_position_m() = ToProto(Eigen::Vector3d(point.x_m, point.y_m, point.z_m));
    known->set_sigma_m(point.sigma_m);
  }
  if (request.source == FrameSource::kDown) {
    *proto.mutable_down() =
        ToProto(Eigen::Vector3d(request.down[0], request.down[1], request.down[2]));
  }
  if (request.source == FrameSource::kTransform) {
    const std::array<double, 4>& q = request.rotation_wxyz;
    const std::array<double, 3>& t = request.translation_m;
    *proto.mutable_new_from_rig() = ToProto(RigidTransform(
        Eigen::Quaterniond(q[0], q[1], q[2], q[3]), Eigen::Vector3d(t[0], t[1], t[2])));
  }
  WriteMeasured(request.measured, proto.mutable_measured());
  proto.set_still_s(request.still_s);
  proto.set_max_residual_m(request.max_residual_m);
  proto.set_max_rotation_sigma_rad(request.max_rotation_sigma_rad);
  proto.set_cameras_below(request.cameras_below);
  return proto;
}

absl::StatusOr<OriginRequest> FromProto(const v1::OriginOptions& proto) {
  if (!v1::FrameSource_IsValid(proto.source())) {
    return absl::InvalidArgumentError(
        absl::StrCat("origin.source: ", static_cast<int>(proto.source()), " is not known"));
  }
  OriginRequest request;
  request.source = static_cast<FrameSource>(proto.source());
  request.height_m = proto.height_m();
  for (const v1::KnownPoint& known : proto.points()) {
    request.points.push_back({known.label(), known.position_m().x(), known.position_m().y(),
                              known.position_m().z(), known.sigma_m()});
  }
  request.down = {proto.down().x(), proto.down().y(), proto.down().z()};
  if (request.source == FrameSource::kTransform) {
    const v1::Quaternion& q = proto.new_from_rig().rotation();
    const v1::Vector3& t = proto.new_from_rig().translation_m();
    request.rotation_wxyz = {q.w(), q.x(), q.y(), q.z()};
    request.translation_m = {t.x(), t.y(), t.z()};
  }
  request.measured = ReadMeasured(proto.measured());
  request.still_s = proto.still_s();
  request.max_residual_m = proto.max_residual_m();
  request.max_rotation_sigma_rad = proto.max_rotation_sigma_rad();
  request.cameras_below = proto.cameras_below();
  return request;
}

v1::ScaleOptions ToProto(const ScaleRequest& request) {
  v1::ScaleOptions proto;
  for (const CameraDistance& distance : request.distances) {
    v1::CameraDistance* const out = proto.add_distances();
    out->set_camera_a(distance.camera_a);
    out->set_camera_b(distance.camera_b);
    out->set_distance_m(distance.distance_m);
    out->set_sigma_m(distance.sigma_m);
  }
  for (const KnownLength& length : request.lengths) {
    v1::KnownLength* const out = proto.add_lengths();
    out->set_marker_a(static_cast<uint32_t>(length.marker_a));
    out->set_marker_b(static_cast<uint32_t>(length.marker_b));
    out->set_length_m(length.length_m);
    out->set_sigma_m(length.sigma_m);
    out->set_name(length.name);
  }
  WriteMeasured(request.measured, proto.mutable_measured());
  proto.mutable_leave_out()->Assign(request.leave_out.begin(), request.leave_out.end());
  return proto;
}

ScaleRequest FromProto(const v1::ScaleOptions& proto) {
  ScaleRequest request;
  for (const v1::CameraDistance& distance : proto.distances()) {
    request.distances.push_back(
        {distance.camera_a(), distance.camera_b(), distance.distance_m(), distance.sigma_m()});
  }
  for (const v1::KnownLength& length : proto.lengths()) {
    request.lengths.push_back({IndexOf(length.marker_a()), IndexOf(length.marker_b()),
                               length.length_m(), length.sigma_m(), length.name()});
  }
  request.measured = ReadMeasured(proto.measured());
  request.leave_out.assign(proto.leave_out().begin(), proto.leave_out().end());
  return request;
}

v1::CalibrationFrame ToProto(const CalibrationFrame& frame) {
  v1::CalibrationFrame proto;
  proto.set_source(static_cast<v1::FrameSource>(frame.source));
  proto.set_calibration_id(frame.calibration_id);
  *proto.mutable_new_from_rig() = ToProto(frame.new_from_rig);
  *proto.mutable_rotation_sigma_rad() = ToProto(frame.rotation_sigma_rad);
  *proto.mutable_position_sigma_m() = ToProto(frame.position_sigma_m);
  proto.set_residual_rms_m(frame.residual_rms_m);
  for (const PointResidual& residual : frame.residuals) {
    v1::PointResidual* const out = proto.add_residuals();
    out->set_name(residual.name);
    out->set_residual_m(residual.residual_m);
    out->set_sigma_m(residual.sigma_m);
  }
  proto.set_residual_count(frame.residual_count);
  proto.set_lowest_camera(frame.lowest_camera);
  proto.set_lowest_camera_m(frame.lowest_camera_m);
  proto.mutable_cameras()->Assign(frame.cameras.begin(), frame.cameras.end());
  proto.set_problem(frame.problem);
  return proto;
}

absl::StatusOr<CalibrationFrame> FromProto(const v1::CalibrationFrame& proto) {
  CalibrationFrame frame;
  if (v1::FrameSource_IsValid(proto.source())) {
    frame.source = static_cast<FrameSource>(proto.source());
  }
  frame.calibration_id = proto.calibration_id();
  RIGCAL_ASSIGN_OR_RETURN(frame.new_from_rig, FromProto(proto.new_from_rig()));
  frame.rotation_sigma_rad = FromProto(proto.rotation_sigma_rad());
  frame.position_sigma_m = FromProto(proto.position_sigma_m());
  frame.residual_rms_m = proto.residual_rms_m();
  for (const v1::PointResidual& residual : proto.residuals()) {
    frame.residuals.push_back({residual.name(), residual.residual_m(), residual.sigma_m()});
  }
  frame.residual_count = proto.residual_count();
  frame.lowest_camera = proto.lowest_camera();
  frame.lowest_camera_m = proto.lowest_camera_m();
  frame.cameras.assign(proto.cameras().begin(), proto.cameras().end());
  frame.problem = proto.problem();
  return frame;
}

v1::CalibrationScale ToProto(const CalibrationScale& scale) {
  v1::CalibrationScale proto;
  proto.set_calibration_id(scale.calibration_id);
  proto.set_factor(scale.factor);
  proto.set_sigma_rel(scale.sigma_rel);
  for (const ScaleSourceReport& source : scale.sources) {
    v1::ScaleSourceReport* const out = proto.add_sources();
    out->set_name(source.name);
    out->set_own_change(source.own_change);
    out->set_own_sigma(source.own_sigma);
    out->set_from_others(source.from_others);
    out->set_from_others_sigmas(source.from_others_sigmas);
  }
  return proto;
}

CalibrationScale FromProto(const v1::CalibrationScale& proto) {
  CalibrationScale scale;
  scale.calibration_id = proto.calibration_id();
  scale.factor = proto.factor();
  scale.sigma_rel = proto.sigma_rel();
  for (const v1::ScaleSourceReport& source : proto.sources()) {
    scale.sources.push_back({source.name(), source.own_change(), source.own_sigma(),
                             source.from_others(), source.from_others_sigmas()});
  }
  return scale;
}

v1::CalibrationInformation ToProto(const CalibrationInformation& information) {
  v1::CalibrationInformation proto;
  for (const InformationGroup& group : information.groups) {
    v1::InformationGroup* const out = proto.add_groups();
    out->set_kind(static_cast<v1::InformationGroup::Kind>(group.kind));
    out->set_session_id(group.session_id);
    out->set_from_s(group.from_s);
    out->set_to_s(group.to_s);
    out->set_camera(group.camera);
    out->set_instant_count(group.instant_count);
  }
  for (const ParameterInformation& parameter : information.parameters) {
    v1::ParameterInformation* const out = proto.add_parameters();
    out->set_camera(parameter.camera);
    out->set_kind(static_cast<v1::ParameterInformation::Kind>(parameter.kind));
    out->set_name(parameter.name);
    out->set_sigma(parameter.sigma);
    out->mutable_share()->Assign(parameter.share.begin(), parameter.share.end());
  }
  proto.set_calibration_id(information.calibration_id);
  proto.set_stride(information.stride);
  return proto;
}

CalibrationInformation FromProto(const v1::CalibrationInformation& proto) {
  CalibrationInformation information;
  for (const v1::InformationGroup& group : proto.groups()) {
    information.groups.push_back({static_cast<InformationGroup::Kind>(group.kind()),
                                  group.session_id(), group.from_s(), group.to_s(), group.camera(),
                                  group.instant_count()});
  }
  for (const v1::ParameterInformation& parameter : proto.parameters()) {
    information.parameters.push_back({parameter.camera(),
                                      static_cast<ParameterInformation::Kind>(parameter.kind()),
                                      parameter.name(),
                                      parameter.sigma(),
                                      {parameter.share().begin(), parameter.share().end()}});
  }
  information.calibration_id = proto.calibration_id();
  information.stride = proto.stride();
  return information;
}

}  // namespace rigcal::wire

// SPDX-License-Identifier: Apache-2.0
#include "common/wire/calibration_result_wire.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/wire/camera_wire.h"
#include "common/wire/frame_wire.h"
#include "common/wire/observation_wire.h"

namespace rigcal::wire {
namespace {

static_assert(static_cast<int>(QualityGrade::kGood) == v1::Quality::GRADE_GOOD);
static_assert(static_cast<int>(QualityGrade::kUsable) == v1::Quality::GRADE_USABLE);
static_assert(static_cast<int>(QualityGrade::kBad) == v1::Quality::GRADE_BAD);
static_assert(static_cast<int>(FindingSeverity::kInfo) == v1::FINDING_SEVERITY_INFO);
static_assert(static_cast<int>(FindingSeverity::kWarning) == v1::FINDING_SEVERITY_WARNING);
static_assert(static_cast<int>(FindingSeverity::kError) == v1::FINDING_SEVERITY_ERROR);

// Between a vector and a repeated field.
template <typename From, typename To>
void Copy(const From& from, To* to) {
  *to = To(from.begin(), from.end());
}

v1::ErrorFigures ToProto(const ErrorFigures& figures) {
  v1::ErrorFigures proto;
  proto.set_mean_px(figures.mean_px);
  proto.set_rms_px(figures.rms_px);
  proto.set_median_px(figures.median_px);
  proto.set_p95_px(figures.p95_px);
  proto.set_marker_count(figures.marker_count);
  return proto;
}

ErrorFigures FromProto(const v1::ErrorFigures& proto) {
  return {proto.mean_px(), proto.rms_px(), proto.median_px(), proto.p95_px(), proto.marker_count()};
}

v1::Residuals ToProto(const Residuals& residuals) {
  v1::Residuals proto;
  *proto.mutable_all() = ToProto(residuals.all);
  *proto.mutable_inlier() = ToProto(residuals.inlier);
  proto.set_observation_count(residuals.observation_count);
  proto.set_outlier_count(residuals.outlier_count);
  return proto;
}

Residuals FromProto(const v1::Residuals& proto) {
  return {FromProto(proto.all()), FromProto(proto.inlier()), proto.observation_count(),
          proto.outlier_count()};
}

v1::CameraUncertainty ToProto(const CameraUncertainty& uncertainty) {
  v1::CameraUncertainty proto;
  *proto.mutable_rotation_sigma_rad() = wire::ToProto(uncertainty.rotation_sigma_rad);
  *proto.mutable_position_sigma_m() = wire::ToProto(uncertainty.position_sigma_m);
  proto.set_time_offset_sigma_s(uncertainty.time_offset_sigma_s);
  proto.set_time_rate_sigma_ppm(uncertainty.time_rate_sigma_ppm);
  Copy(uncertainty.intrinsics_sigma, proto.mutable_intrinsics_sigma());
  return proto;
}

CameraUncertainty FromProto(const v1::CameraUncertainty& proto) {
  return {wire::FromProto(proto.rotation_sigma_rad()),
          wire::FromProto(proto.position_sigma_m()),
          proto.time_offset_sigma_s(),
          proto.time_rate_sigma_ppm(),
          {proto.intrinsics_sigma().begin(), proto.intrinsics_sigma().end()}};
}

void FillCamera(const CalibratedCamera& camera, v1::CalibratedCamera* proto) {
  proto->set_camera(camera.camera);
  *proto->mutable_image_size_px() = wire::ToProto(camera.image_size_px);
  *proto->mutable_cam_from_rig() = wire::ToProto(camera.cam_from_rig);
  *proto->mutable_intrinsics() = wire::ToProto(camera.intrinsics);
  proto->set_intrinsics_refined(camera.intrinsics_refined);
  proto->set_clock_id(camera.clock_id);
  proto->set_time_offset_s(camera.time_offset_s);
  proto->set_time_rate_ppm(camera.time_rate_ppm);
  proto->set_time_epoch_s(camera.time_epoch_s);
  proto->set_time_offset_estimated(camera.time_offset_estimated);
  proto->set_line_delay_s(camera.line_delay_s);
  proto->set_line_delay_sigma_s(camera.line_delay_sigma_s);
  for (const ClockCoursePoint& point : camera.clock_course) {
    v1::ClockCoursePoint* added = proto->add_clock_course();
    added->set_camera_time_ns(point.camera_time_ns);
    added->set_offset_s(point.offset_s);
  }
  *proto->mutable_residuals() = ToProto(camera.residuals);
  if (camera.uncertainty) *proto->mutable_uncertainty() = ToProto(*camera.uncertainty);
  if (camera.held_out) *proto->mutable_held_out() = ToProto(*camera.held_out);
  if (camera.leave_one_out) *proto->mutable_leave_one_out() = ToProto(*camera.leave_one_out);
  proto->set_observation_count(camera.observation_count);
  proto->set_wand_count(camera.wand_count);
}

absl::StatusOr<CalibratedCamera> CameraFromProto(const v1::CalibratedCamera& proto) {
  CalibratedCamera camera;
  camera.camera = proto.camera();
  camera.image_size_px = wire::FromProto(proto.image_size_px());
  RIGCAL_ASSIGN_OR_RETURN(camera.cam_from_rig, wire::FromProto(proto.cam_from_rig()));
  RIGCAL_ASSIGN_OR_RETURN(camera.intrinsics, wire::FromProto(proto.intrinsics()));
  camera.intrinsics_refined = proto.intrinsics_refined();
  camera.clock_id = proto.clock_id();
  camera.time_offset_s = proto.time_offset_s();
  camera.time_rate_ppm = proto.time_rate_ppm();
  camera.time_epoch_s = proto.time_epoch_s();
  camera.time_offset_estimated = proto.time_offset_estimated();
  camera.line_delay_s = proto.line_delay_s();
  camera.line_delay_sigma_s = proto.line_delay_sigma_s();
  for (const v1::ClockCoursePoint& point : proto.clock_course()) {
    camera.clock_course.push_back({point.camera_time_ns(), point.offset_s()});
  }
  camera.residuals = FromProto(proto.residuals());
  if (proto.has_uncertainty()) camera.uncertainty = FromProto(proto.uncertainty());
  if (proto.has_held_out()) camera.held_out = FromProto(proto.held_out());
  if (proto.has_leave_one_out()) camera.leave_one_out = FromProto(proto.leave_one_out());
  camera.observation_count = proto.observation_count();
  camera.wand_count = proto.wand_count();
  return camera;
}

void FillTarget(const CalibratedTarget& target, v1::CalibratedTarget* proto) {
  *proto->mutable_given() = wire::ToProto(target.given);
  Copy(target.marker_positions_m, proto->mutable_marker_positions_m());
  proto->set_marker_positions_estimated(target.marker_positions_estimated);
  Copy(target.marker_position_sigma_m, proto->mutable_marker_position_sigma_m());
  proto->set_scale_sigma_rel(target.scale_sigma_rel);
  proto->set_length_error_rms_m(target.length_error_rms_m);
  for (const SpanError& span : target.spans) {
    v1::SpanError* out = proto->add_spans();
    out->set_length_m(span.length_m);
    out->set_mean_error_m(span.mean_error_m);
    out->set_error_rms_m(span.error_rms_m);
    out->set_count(span.count);
    out->set_held_out_error_rms_m(span.held_out_error_rms_m);
    out->set_held_out_count(span.held_out_count);
  }
  Copy(target.session_ids, proto->mutable_session_ids());
  for (const CalibratedPoint& point : target.static_points) {
    v1::CalibratedPoint* out = proto->add_static_points();
    out->set_label(point.label);
    out->set_session_id(point.session_id);
    *out->mutable_position_m() = wire::ToProto(point.position_m);
    out->set_camera_count(point.camera_count);
  }
}

absl::StatusOr<CalibratedTarget> TargetFromProto(const v1::CalibratedTarget& proto) {
  CalibratedTarget target;
  RIGCAL_ASSIGN_OR_RETURN(target.given, wire::FromProto(proto.given()));
  Copy(proto.marker_positions_m(), &target.marker_positions_m);
  target.marker_positions_estimated = proto.marker_positions_estimated();
  Copy(proto.marker_position_sigma_m(), &target.marker_position_sigma_m);
  target.scale_sigma_rel = proto.scale_sigma_rel();
  target.length_error_rms_m = proto.length_error_rms_m();
  for (const v1::SpanError& span : proto.spans()) {
    target.spans.push_back({span.length_m(), span.mean_error_m(), span.error_rms_m(), span.count(),
                            span.held_out_error_rms_m(), span.held_out_count()});
  }
  Copy(proto.session_ids(), &target.session_ids);
  for (const v1::CalibratedPoint& point : proto.static_points()) {
    target.static_points.push_back({point.label(), point.session_id(),
                                    wire::FromProto(point.position_m()), point.camera_count()});
  }
  return target;
}

// What a later version has added must not cost the calibration: a kind that is not known keeps its
// number, and a severity is taken for a warning.
Finding FromProto(const v1::Finding& proto) {
  Finding finding;
  if (v1::FindingKind_IsValid(proto.kind())) {
    finding.kind = static_cast<FindingKind>(proto.kind());
  } else {
    finding.unknown_kind = proto.kind();
  }
  finding.camera = proto.camera();
  finding.value = proto.value();
  finding.unit = proto.unit();
  finding.advice = proto.advice();
  finding.severity = FindingSeverity::kWarning;
  if (v1::FindingSeverity_IsValid(proto.severity()) &&
      proto.severity() != v1::FINDING_SEVERITY_UNSPECIFIED) {
    finding.severity = static_cast<FindingSeverity>(proto.severity());
  }
  finding.candidate = proto.candidate();
  return finding;
}

ErrorBasis FromProto(v1::Headline::ErrorBasis basis) {
  return v1::Headline::ErrorBasis_IsValid(basis) ? static_cast<ErrorBasis>(basis)
                                                 : ErrorBasis::kUnknown;
}

SolverPath FromProto(v1::SolverPath path) {
  return v1::SolverPath_IsValid(path) ? static_cast<SolverPath>(path) : SolverPath::kUnknown;
}

void FillTrajectory(const CalibratedTrajectory& trajectory, v1::CalibratedTrajectory* proto) {
  proto->set_kind(static_cast<v1::CalibratedTrajectory::Kind>(trajectory.kind));
  proto->set_knot_spacing_s(trajectory.knot_spacing_s);
  proto->set_jerk_density(trajectory.jerk_density);
  proto->set_added_row_count(trajectory.added_row_count);
  proto->set_held_out_interpolated_px(trajectory.held_out_interpolated_px);
  proto->set_held_out_spline_px(trajectory.held_out_spline_px);
}

CalibratedTrajectory FromProto(const v1::CalibratedTrajectory& proto) {
  CalibratedTrajectory trajectory;
  if (v1::CalibratedTrajectory::Kind_IsValid(proto.kind())) {
    trajectory.kind = static_cast<CalibratedTrajectory::Kind>(proto.kind());
  }
  trajectory.knot_spacing_s = proto.knot_spacing_s();
  trajectory.jerk_density = proto.jerk_density();
  trajectory.added_row_count = proto.added_row_count();
  trajectory.held_out_interpolated_px = proto.held_out_interpolated_px();
  trajectory.held_out_spline_px = proto.held_out_spline_px();
  return trajectory;
}

}  // namespace

void FillResult(const CalibrationResult& result, v1::Calibration* proto) {
  proto->set_scale_known(result.scale_known);
  proto->set_unit_camera(result.unit_camera);
  proto->set_reference_camera(result.reference_camera);
  proto->set_instant_count(result.instant_count);
  for (const CalibratedCamera& camera : result.cameras) FillCamera(camera, proto->add_cameras());
  if (result.target.given.marker_count() > 0) FillTarget(result.target, proto->mutable_target());
  for (const CalibratedTarget& other : result.other_targets) {
    FillTarget(other, proto->add_other_targets());
  }
  for (const Refusal& refusal : result.refused) *proto->add_refused() = wire::ToProto(refusal);
  for (const Finding& finding : result.findings) {
    v1::Finding* out = proto->add_findings();
    const bool is_known = finding.kind != FindingKind::kUnspecified;
    out->set_kind(is_known ? static_cast<v1::FindingKind>(finding.kind)
                           : static_cast<v1::FindingKind>(finding.unknown_kind));
    out->set_severity(static_cast<v1::FindingSeverity>(finding.severity));
    out->set_camera(finding.camera);
    out->set_value(finding.value);
    out->set_unit(finding.unit);
    out->set_advice(finding.advice);
    out->set_candidate(finding.candidate);
  }
  proto->set_observation_digest(result.observation_digest);
  proto->mutable_quality()->set_grade(static_cast<v1::Quality::Grade>(result.quality.grade));
  Copy(result.quality.reasons, proto->mutable_quality()->mutable_reasons());
  if (result.headline) {
    proto->mutable_headline()->set_point_error_m(result.headline->point_error_m);
    proto->mutable_headline()->set_point_error_bound_m(result.headline->point_error_bound_m);
    proto->mutable_headline()->set_used_mean_px(result.headline->used_mean_px);
    proto->mutable_headline()->set_unused_share(result.headline->unused_share);
    proto->mutable_headline()->set_scale_sigma_rel(result.target.scale_sigma_rel);
    proto->mutable_headline()->set_point_error_basis(
        static_cast<v1::Headline::ErrorBasis>(result.headline->point_error_basis));
  }
  proto->mutable_quality()->set_predicted_error_m(result.quality.predicted_error_m);
  proto->mutable_quality()->set_accepted_error_m(result.quality.accepted_error_m);
  proto->mutable_run()->set_iteration_count(result.iteration_count);
  proto->set_solver_path(static_cast<v1::SolverPath>(result.solver_path));
  if (result.trajectory.kind != CalibratedTrajectory::Kind::kUnknown) {
    FillTrajectory(result.trajectory, proto->mutable_trajectory());
  }
  if (result.wand_volume) {
    *proto->mutable_wand_volume()->mutable_min_m() = wire::ToProto(result.wand_volume->min_m);
    *proto->mutable_wand_volume()->mutable_max_m() = wire::ToProto(result.wand_volume->max_m);
  }
  if (result.frame) *proto->mutable_frame() = wire::ToProto(*result.frame);
  if (result.scale) *proto->mutable_scale() = wire::ToProto(*result.scale);
}

absl::StatusOr<CalibrationResult> ResultFromProto(const v1::Calibration& proto) {
  CalibrationResult result;
  result.scale_known = proto.scale_known();
  result.unit_camera = proto.unit_camera();
  result.reference_camera = proto.reference_camera();
  result.instant_count = proto.instant_count();
  for (const v1::CalibratedCamera& camera : proto.cameras()) {
    RIGCAL_ASSIGN_OR_RETURN(CalibratedCamera parsed, CameraFromProto(camera));
    result.cameras.push_back(std::move(parsed));
  }
  // A calibration of another program has no target.
  if (proto.has_target()) {
    RIGCAL_ASSIGN_OR_RETURN(result.target, TargetFromProto(proto.target()));
  }
  for (const v1::CalibratedTarget& other : proto.other_targets()) {
    RIGCAL_ASSIGN_OR_RETURN(CalibratedTarget parsed, TargetFromProto(other));
    result.other_targets.push_back(std::move(parsed));
  }
  for (const v1::RefusalCount& refusal : proto.refused()) {
    result.refused.push_back(wire::FromProto(refusal));
  }
  for (const v1::Finding& finding : proto.findings()) {
    result.findings.push_back(FromProto(finding));
  }
  result.observation_digest = proto.observation_digest();
  if (v1::Quality::Grade_IsValid(proto.quality().grade())) {
    result.quality.grade = static_cast<QualityGrade>(proto.quality().grade());
  }
  Copy(proto.quality().reasons(), &result.quality.reasons);
  if (proto.has_headline()) {
    result.headline = {.point_error_m = proto.headline().point_error_m(),
                       .point_error_bound_m = proto.headline().point_error_bound_m(),
                       .used_mean_px = proto.headline().used_mean_px(),
                       .unused_share = proto.headline().unused_share(),
                       .point_error_basis = FromProto(proto.headline().point_error_basis())};
  }
  result.quality.predicted_error_m = proto.quality().predicted_error_m();
  result.quality.accepted_error_m = proto.quality().accepted_error_m();
  result.iteration_count = proto.run().iteration_count();
  result.solver_path = FromProto(proto.solver_path());
  result.trajectory = FromProto(proto.trajectory());
  if (proto.has_wand_volume()) {
    result.wand_volume = {wire::FromProto(proto.wand_volume().min_m()),
                          wire::FromProto(proto.wand_volume().max_m())};
  }
  if (proto.has_frame()) {
    RIGCAL_ASSIGN_OR_RETURN(result.frame, wire::FromProto(proto.frame()));
  }
  if (proto.has_scale()) result.scale = wire::FromProto(proto.scale());
  return result;
}

v1::CameraResiduals ToProto(const CameraResiduals& residuals) {
  v1::CameraResiduals proto;
  proto.set_camera(residuals.camera);
  *proto.mutable_image_size_px() = ToProto(residuals.image_size_px);
  for (const CameraResiduals::Vector& vector : residuals.vectors) {
    proto.add_x_px(vector.x_px);
    proto.add_y_px(vector.y_px);
    proto.add_dx_px(vector.dx_px);
    proto.add_dy_px(vector.dy_px);
    proto.add_outlier(vector.outlier);
  }
  proto.set_bin_px(residuals.bin_px);
  Copy(residuals.inlier_counts, proto.mutable_inlier_counts());
  Copy(residuals.outlier_counts, proto.mutable_outlier_counts());
  return proto;
}

CameraResiduals FromProto(const v1::CameraResiduals& proto) {
  CameraResiduals residuals;
  residuals.camera = proto.camera();
  residuals.image_size_px = wire::FromProto(proto.image_size_px());
  const int count = std::min({proto.x_px_size(), proto.y_px_size(), proto.dx_px_size(),
                              proto.dy_px_size(), proto.outlier_size()});
  for (int i = 0; i < count; ++i) {
    residuals.vectors.push_back(
        {proto.x_px(i), proto.y_px(i), proto.dx_px(i), proto.dy_px(i), proto.outlier(i)});
  }
  residuals.bin_px = proto.bin_px();
  Copy(proto.inlier_counts(), &residuals.inlier_counts);
  Copy(proto.outlier_counts(), &residuals.outlier_counts);
  return residuals;
}

}  // namespace rigcal::wire

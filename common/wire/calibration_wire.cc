// SPDX-License-Identifier: Apache-2.0
#include "common/wire/calibration_wire.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/wire/camera_wire.h"
#include "common/wire/observation_wire.h"
#include "common/wire/time_wire.h"
#include "rigcal/storage/v1/calibration.pb.h"

namespace rigcal::wire {
namespace {

static_assert(static_cast<int>(CalibrationState::kQueued) == v1::Calibration::STATE_QUEUED);
static_assert(static_cast<int>(CalibrationState::kRunning) == v1::Calibration::STATE_RUNNING);
static_assert(static_cast<int>(CalibrationState::kSucceeded) == v1::Calibration::STATE_SUCCEEDED);
static_assert(static_cast<int>(CalibrationState::kFailed) == v1::Calibration::STATE_FAILED);
static_assert(static_cast<int>(Estimate::kFixed) == v1::CalibrationOptions::ESTIMATE_FIXED);
static_assert(static_cast<int>(Estimate::kRefined) == v1::CalibrationOptions::ESTIMATE_REFINED);
static_assert(static_cast<int>(Estimate::kAuto) == v1::CalibrationOptions::ESTIMATE_AUTO);
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
  return target;
}

void FillResult(const CalibrationResult& result, v1::Calibration* proto) {
  proto->set_scale_known(result.scale_known);
  proto->set_unit_camera(result.unit_camera);
  proto->set_reference_camera(result.reference_camera);
  proto->set_instant_count(result.instant_count);
  for (const CalibratedCamera& camera : result.cameras) FillCamera(camera, proto->add_cameras());
  FillTarget(result.target, proto->mutable_target());
  for (const CalibratedTarget& other : result.other_targets) {
    FillTarget(other, proto->add_other_targets());
  }
  for (const Refusal& refusal : result.refused) *proto->add_refused() = wire::ToProto(refusal);
  for (const Finding& finding : result.findings) {
    v1::Finding* out = proto->add_findings();
    out->set_kind(static_cast<v1::FindingKind>(finding.kind));
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
  proto->mutable_quality()->set_predicted_error_m(result.quality.predicted_error_m);
  proto->mutable_quality()->set_accepted_error_m(result.quality.accepted_error_m);
  proto->mutable_run()->set_iteration_count(result.iteration_count);
  proto->set_solver_path(static_cast<v1::SolverPath>(result.solver_path));
  if (result.wand_volume) {
    *proto->mutable_wand_volume()->mutable_min_m() = wire::ToProto(result.wand_volume->min_m);
    *proto->mutable_wand_volume()->mutable_max_m() = wire::ToProto(result.wand_volume->max_m);
  }
}

absl::StatusOr<Finding> FindingFromProto(const v1::Finding& proto) {
  if (!v1::FindingKind_IsValid(proto.kind()) || proto.kind() == v1::FINDING_KIND_UNSPECIFIED) {
    return absl::InvalidArgumentError(
        absl::StrCat("finding.kind: ", static_cast<int>(proto.kind()), " is not known"));
  }
  if (!v1::FindingSeverity_IsValid(proto.severity()) ||
      proto.severity() == v1::FINDING_SEVERITY_UNSPECIFIED) {
    return absl::InvalidArgumentError(
        absl::StrCat("finding.severity: ", static_cast<int>(proto.severity()), " is not known"));
  }
  return Finding{static_cast<FindingKind>(proto.kind()),
                 proto.camera(),
                 proto.value(),
                 proto.unit(),
                 proto.advice(),
                 static_cast<FindingSeverity>(proto.severity()),
                 proto.candidate()};
}

SolverPath FromProto(v1::SolverPath path) {
  return v1::SolverPath_IsValid(path) ? static_cast<SolverPath>(path) : SolverPath::kUnknown;
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
  RIGCAL_ASSIGN_OR_RETURN(result.target, TargetFromProto(proto.target()));
  for (const v1::CalibratedTarget& other : proto.other_targets()) {
    RIGCAL_ASSIGN_OR_RETURN(CalibratedTarget parsed, TargetFromProto(other));
    result.other_targets.push_back(std::move(parsed));
  }
  for (const v1::RefusalCount& refusal : proto.refused()) {
    result.refused.push_back(wire::FromProto(refusal));
  }
  for (const v1::Finding& finding : proto.findings()) {
    RIGCAL_ASSIGN_OR_RETURN(Finding parsed, FindingFromProto(finding));
    result.findings.push_back(std::move(parsed));
  }
  result.observation_digest = proto.observation_digest();
  if (!v1::Quality::Grade_IsValid(proto.quality().grade())) {
    return absl::InvalidArgumentError("quality.grade: not a known grade");
  }
  result.quality.grade = static_cast<QualityGrade>(proto.quality().grade());
  Copy(proto.quality().reasons(), &result.quality.reasons);
  result.quality.predicted_error_m = proto.quality().predicted_error_m();
  result.quality.accepted_error_m = proto.quality().accepted_error_m();
  result.iteration_count = proto.run().iteration_count();
  result.solver_path = FromProto(proto.solver_path());
  if (proto.has_wand_volume()) {
    result.wand_volume = {wire::FromProto(proto.wand_volume().min_m()),
                          wire::FromProto(proto.wand_volume().max_m())};
  }
  return result;
}

}  // namespace

v1::CalibrationOptions ToProto(const CalibrationOptions& options) {
  v1::CalibrationOptions proto;
  proto.set_reference_camera(options.reference_camera);
  proto.set_intrinsics(static_cast<v1::CalibrationOptions::Estimate>(options.intrinsics));
  proto.set_time_offsets(static_cast<v1::CalibrationOptions::Estimate>(options.time_offsets));
  proto.set_marker_positions(
      static_cast<v1::CalibrationOptions::Estimate>(options.marker_positions));
  proto.set_sigma_px(options.sigma_px);
  proto.set_association_tolerance_s(options.association_tolerance_s);
  proto.set_seed(options.seed);
  proto.set_accept_m(options.accept_m);
  if (options.known_distance) {
    v1::KnownDistance* known = proto.mutable_known_distance();
    known->set_camera_a(options.known_distance->camera_a);
    known->set_camera_b(options.known_distance->camera_b);
    known->set_distance_m(options.known_distance->distance_m);
    known->set_sigma_m(options.known_distance->sigma_m);
  }
  return proto;
}

absl::StatusOr<CalibrationOptions> FromProto(const v1::CalibrationOptions& proto) {
  for (const auto& [field, value] : {std::pair("intrinsics", proto.intrinsics()),
                                     std::pair("time_offsets", proto.time_offsets()),
                                     std::pair("marker_positions", proto.marker_positions())}) {
    if (!v1::CalibrationOptions::Estimate_IsValid(value)) {
      return absl::InvalidArgumentError(
          absl::StrCat("options.", field, ": ", static_cast<int>(value), " is not known"));
    }
  }
  CalibrationOptions options;
  options.reference_camera = proto.reference_camera();
  options.intrinsics = static_cast<Estimate>(proto.intrinsics());
  options.time_offsets = static_cast<Estimate>(proto.time_offsets());
  options.marker_positions = static_cast<Estimate>(proto.marker_positions());
  options.sigma_px = proto.sigma_px();
  options.association_tolerance_s = proto.association_tolerance_s();
  options.seed = proto.seed();
  options.accept_m = proto.accept_m();
  if (proto.has_known_distance()) {
    const v1::KnownDistance& known = proto.known_distance();
    options.known_distance = {known.camera_a(), known.camera_b(), known.distance_m(),
                              known.sigma_m()};
  }
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  return options;
}

v1::Calibration ToProto(const Calibration& calibration) {
  v1::Calibration proto;
  proto.set_id(calibration.id);
  proto.set_rig(calibration.rig);
  proto.set_version(calibration.version);
  Copy(calibration.session_ids, proto.mutable_session_ids());
  proto.set_state(static_cast<v1::Calibration::State>(calibration.state));
  proto.set_error(calibration.error);
  proto.mutable_progress()->set_stage(
      static_cast<v1::CalibrationStage>(calibration.progress_stage));
  proto.mutable_progress()->set_fraction(calibration.progress_fraction);
  *proto.mutable_options() = ToProto(calibration.options);
  if (calibration.result) {
    FillResult(*calibration.result, &proto);
  } else {
    for (const Refusal& refusal : calibration.refused) *proto.add_refused() = ToProto(refusal);
  }
  v1::CalibrationRun* run = proto.mutable_run();
  if (calibration.create_utc_ns) {
    *run->mutable_create_time() = ToTimestamp(calibration.create_utc_ns);
  }
  if (calibration.start_utc_ns) *run->mutable_start_time() = ToTimestamp(calibration.start_utc_ns);
  if (calibration.end_utc_ns) *run->mutable_end_time() = ToTimestamp(calibration.end_utc_ns);
  *run->mutable_solve_duration() = ToDuration(calibration.duration_s);
  run->set_software_version(calibration.software_version);
  proto.set_damage(calibration.damage);
  return proto;
}

absl::StatusOr<Calibration> FromProto(const v1::Calibration& proto) {
  Calibration calibration;
  calibration.id = proto.id();
  calibration.rig = proto.rig();
  calibration.version = proto.version();
  Copy(proto.session_ids(), &calibration.session_ids);
  if (proto.state() < v1::Calibration::STATE_QUEUED ||
      proto.state() > v1::Calibration::STATE_FAILED) {
    return absl::InvalidArgumentError(
        absl::StrCat("calibration ", proto.id(), ": state: not a known state"));
  }
  calibration.state = static_cast<CalibrationState>(proto.state());
  calibration.error = proto.error();
  if (v1::CalibrationStage_IsValid(proto.progress().stage())) {
    calibration.progress_stage = static_cast<CalibrationStage>(proto.progress().stage());
  }
  calibration.progress_fraction = proto.progress().fraction();
  RIGCAL_ASSIGN_OR_RETURN(calibration.options, FromProto(proto.options()));
  if (calibration.state == CalibrationState::kSucceeded) {
    RIGCAL_ASSIGN_OR_RETURN(calibration.result, ResultFromProto(proto));
  } else {
    for (const v1::RefusalCount& refusal : proto.refused()) {
      calibration.refused.push_back(FromProto(refusal));
    }
  }
  const v1::CalibrationRun& run = proto.run();
  calibration.create_utc_ns = FromTimestamp(run.create_time());
  calibration.start_utc_ns = FromTimestamp(run.start_time());
  calibration.end_utc_ns = FromTimestamp(run.end_time());
  calibration.duration_s = SecondsOf(run.solve_duration());
  calibration.software_version = run.software_version();
  return calibration;
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

std::string SerializeCalibration(const Calibration& calibration) {
  std::string bytes;
  {
    google::protobuf::io::StringOutputStream stream(&bytes);
    google::protobuf::io::CodedOutputStream output(&stream);
    output.SetSerializationDeterministic(true);
    storage::v1::StoredCalibration stored;
    *stored.mutable_calibration() = ToProto(calibration);
    if (calibration.result && !calibration.result->camera_covariance.empty()) {
      const std::vector<double>& packed = calibration.result->camera_covariance;
      Copy(packed, stored.mutable_camera_covariance()->mutable_packed());
    }
    if (calibration.result) {
      for (const CameraResiduals& camera : calibration.result->residuals) {
        *stored.add_residuals() = ToProto(camera);
      }
    }
    stored.set_attempt_count(calibration.attempt_count);
    stored.SerializeToCodedStream(&output);
  }
  return bytes;
}

absl::StatusOr<Calibration> ParseCalibration(std::string_view bytes) {
  storage::v1::StoredCalibration stored;
  if (!stored.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) {
    return absl::DataLossError("a stored calibration cannot be read: its bytes are damaged");
  }
  RIGCAL_ASSIGN_OR_RETURN(Calibration calibration, FromProto(stored.calibration()));
  calibration.attempt_count = stored.attempt_count();
  if (calibration.result) {
    Copy(stored.camera_covariance().packed(), &calibration.result->camera_covariance);
    for (const v1::CameraResiduals& camera : stored.residuals()) {
      calibration.result->residuals.push_back(FromProto(camera));
    }
  }
  return calibration;
}

}  // namespace rigcal::wire

// SPDX-License-Identifier: Apache-2.0
#include "common/wire/calibration_wire.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/wire/calibration_result_wire.h"
#include "common/wire/camera_wire.h"
#include "common/wire/frame_wire.h"
#include "common/wire/observation_wire.h"
#include "common/wire/time_wire.h"
#include "rigcal/storage/v1/calibration.pb.h"

namespace rigcal::wire {
namespace {

static_assert(static_cast<int>(CalibrationState::kQueued) == v1::Calibration::STATE_QUEUED);
static_assert(static_cast<int>(CalibrationState::kRunning) == v1::Calibration::STATE_RUNNING);
static_assert(static_cast<int>(CalibrationState::kSucceeded) == v1::Calibration::STATE_SUCCEEDED);
static_assert(static_cast<int>(CalibrationState::kFailed) == v1::Calibration::STATE_FAILED);
static_assert(static_cast<int>(CalibrationState::kCancelled) == v1::Calibration::STATE_CANCELLED);
static_assert(static_cast<int>(Estimate::kFixed) == v1::CalibrationOptions::ESTIMATE_FIXED);
static_assert(static_cast<int>(Estimate::kRefined) == v1::CalibrationOptions::ESTIMATE_REFINED);
static_assert(static_cast<int>(Estimate::kAuto) == v1::CalibrationOptions::ESTIMATE_AUTO);
static_assert(static_cast<int>(TrajectoryChoice::kSpline) ==
              v1::CalibrationOptions::TRAJECTORY_SPLINE);

static_assert(static_cast<int>(SolveKind::kRefine) == v1::CalibrationOptions::KIND_REFINE);
static_assert(static_cast<int>(SolveKind::kRepair) == v1::CalibrationOptions::KIND_REPAIR);
static_assert(static_cast<int>(SolveKind::kOrigin) == v1::CalibrationOptions::KIND_ORIGIN);
static_assert(static_cast<int>(SolveKind::kScale) == v1::CalibrationOptions::KIND_SCALE);
static_assert(static_cast<int>(FrameChoice::kOwn) == v1::CalibrationOptions::FRAME_OWN);
static_assert(static_cast<int>(FrameChoice::kKeep) == v1::CalibrationOptions::FRAME_KEEP);
static_assert(static_cast<int>(FrameChoice::kKeepIfPossible) ==
              v1::CalibrationOptions::FRAME_KEEP_IF_POSSIBLE);

// What of options says how a calibration derives from another one. With an error the rest is read
// all the same.
absl::Status ReadDerivation(const v1::CalibrationOptions& proto, CalibrationOptions* options) {
  absl::Status first;
  options->parent_id = proto.parent_id();
  options->only_cameras.assign(proto.only_cameras().begin(), proto.only_cameras().end());
  options->fixed_intrinsics.assign(proto.fixed_intrinsics().begin(),
                                   proto.fixed_intrinsics().end());
  for (const v1::CameraIntrinsics& camera : proto.given_intrinsics()) {
    auto intrinsics = FromProto(camera.intrinsics());
    first.Update(intrinsics.status());
    if (!intrinsics.ok()) continue;
    options->given_intrinsics.push_back(
        {camera.camera(), FromProto(camera.image_size_px()), *std::move(intrinsics)});
  }
  options->what_if = proto.what_if();
  options->without_cameras.assign(proto.without_cameras().begin(), proto.without_cameras().end());
  options->without_sessions.assign(proto.without_sessions().begin(),
                                   proto.without_sessions().end());
  options->from_s = proto.from_s();
  options->to_s = proto.to_s();
  if (proto.has_assumed_target()) {
    auto target = FromProto(proto.assumed_target());
    first.Update(target.status());
    if (target.ok()) options->assumed_target = *std::move(target);
  }
  if (proto.has_origin()) {
    auto origin = FromProto(proto.origin());
    first.Update(origin.status());
    if (origin.ok()) options->origin = *std::move(origin);
  }
  if (proto.has_scale()) options->scale = FromProto(proto.scale());
  return first;
}

// Where a value is not known, `fallback`; `first` gets what is wrong.
template <typename Value>
Value KnownOr(Value fallback, const char* field, int number, bool is_known, absl::Status* first) {
  if (is_known) return static_cast<Value>(number);
  first->Update(
      absl::InvalidArgumentError(absl::StrCat("options.", field, ": ", number, " is not known")));
  return fallback;
}

// As far as they are known here; `first` gets what is wrong first. They are not validated: that is
// for those who ask. Whether they are allowed has been decided for a record that is read, and a
// rule of a later version does not damage it.
CalibrationOptions ReadOptions(const v1::CalibrationOptions& proto, absl::Status* first) {
  using Wire = v1::CalibrationOptions;
  CalibrationOptions options;
  const auto estimate = [first](const char* field, Wire::Estimate value) {
    return KnownOr(Estimate::kDefault, field, value, Wire::Estimate_IsValid(value), first);
  };
  options.intrinsics = estimate("intrinsics", proto.intrinsics());
  options.time_offsets = estimate("time_offsets", proto.time_offsets());
  options.marker_positions = estimate("marker_positions", proto.marker_positions());
  options.trajectory = KnownOr(options.trajectory, "trajectory", proto.trajectory(),
                               Wire::Trajectory_IsValid(proto.trajectory()), first);
  options.kind =
      KnownOr(options.kind, "kind", proto.kind(), Wire::Kind_IsValid(proto.kind()), first);
  options.frame =
      KnownOr(options.frame, "frame", proto.frame(), Wire::Frame_IsValid(proto.frame()), first);
  first->Update(ReadDerivation(proto, &options));
  options.reference_camera = proto.reference_camera();
  options.sigma_px = proto.sigma_px();
  options.association_tolerance_s = proto.association_tolerance_s();
  options.seed = proto.seed();
  options.accept_m = proto.accept_m();
  if (proto.has_known_distance()) {
    const v1::KnownDistance& known = proto.known_distance();
    options.known_distance = {known.camera_a(), known.camera_b(), known.distance_m(),
                              known.sigma_m()};
  }
  return options;
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
  proto.set_trajectory(static_cast<v1::CalibrationOptions::Trajectory>(options.trajectory));
  proto.set_parent_id(options.parent_id);
  proto.set_kind(static_cast<v1::CalibrationOptions::Kind>(options.kind));
  proto.mutable_only_cameras()->Assign(options.only_cameras.begin(), options.only_cameras.end());
  proto.mutable_fixed_intrinsics()->Assign(options.fixed_intrinsics.begin(),
                                           options.fixed_intrinsics.end());
  for (const CameraIntrinsics& given : options.given_intrinsics) {
    v1::CameraIntrinsics* const camera = proto.add_given_intrinsics();
    camera->set_camera(given.camera);
    *camera->mutable_image_size_px() = ToProto(given.image_size_px);
    *camera->mutable_intrinsics() = ToProto(given.intrinsics);
  }
  proto.mutable_without_cameras()->Assign(options.without_cameras.begin(),
                                          options.without_cameras.end());
  proto.mutable_without_sessions()->Assign(options.without_sessions.begin(),
                                           options.without_sessions.end());
  proto.set_from_s(options.from_s);
  proto.set_to_s(options.to_s);
  if (options.assumed_target) *proto.mutable_assumed_target() = ToProto(*options.assumed_target);
  proto.set_what_if(options.what_if);
  if (options.origin) *proto.mutable_origin() = ToProto(*options.origin);
  if (options.scale) *proto.mutable_scale() = ToProto(*options.scale);
  proto.set_frame(static_cast<v1::CalibrationOptions::Frame>(options.frame));
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
  absl::Status first;
  CalibrationOptions options = ReadOptions(proto, &first);
  RIGCAL_RETURN_IF_ERROR(first);
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  return options;
}

v1::Calibration ToProto(const Calibration& calibration) {
  v1::Calibration proto;
  proto.set_id(calibration.id);
  proto.set_rig(calibration.rig);
  proto.set_version(calibration.version);
  proto.mutable_session_ids()->Assign(calibration.session_ids.begin(),
                                      calibration.session_ids.end());
  proto.set_state(static_cast<v1::Calibration::State>(calibration.state));
  proto.set_error(calibration.error);
  proto.mutable_progress()->set_stage(
      static_cast<v1::CalibrationStage>(calibration.progress_stage));
  proto.mutable_progress()->set_fraction(calibration.progress_fraction);
  proto.mutable_progress()->set_not_responding(calibration.not_responding);
  proto.mutable_progress()->set_solved_by(calibration.solved_by);
  proto.mutable_progress()->set_waiting(calibration.waiting);
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
  proto.set_operator_name(calibration.operator_name);
  proto.set_reason(calibration.reason);
  proto.set_notes(calibration.notes);
  proto.mutable_held()->Assign(calibration.held.begin(), calibration.held.end());
  return proto;
}

absl::StatusOr<Calibration> FromProto(const v1::Calibration& proto) {
  Calibration calibration;
  calibration.id = proto.id();
  calibration.rig = proto.rig();
  calibration.version = proto.version();
  calibration.session_ids.assign(proto.session_ids().begin(), proto.session_ids().end());
  if (proto.state() < v1::Calibration::STATE_QUEUED ||
      proto.state() > v1::Calibration::STATE_CANCELLED) {
    return absl::InvalidArgumentError(
        absl::StrCat("calibration ", proto.id(), ": state: not a known state"));
  }
  calibration.state = static_cast<CalibrationState>(proto.state());
  calibration.error = proto.error();
  // Releases before that state.
  if (calibration.state == CalibrationState::kFailed && calibration.error == "cancelled") {
    calibration.state = CalibrationState::kCancelled;
  }
  if (v1::CalibrationStage_IsValid(proto.progress().stage())) {
    calibration.progress_stage = static_cast<CalibrationStage>(proto.progress().stage());
  }
  calibration.progress_fraction = proto.progress().fraction();
  calibration.not_responding = proto.progress().not_responding();
  calibration.solved_by = proto.progress().solved_by();
  calibration.waiting = proto.progress().waiting();
  absl::Status fault;
  calibration.options = ReadOptions(proto.options(), &fault);
  // One that has yet to be solved must be what was asked for.
  if (!HasEnded(calibration.state)) RIGCAL_RETURN_IF_ERROR(fault);
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
  calibration.operator_name = proto.operator_name();
  calibration.reason = proto.reason();
  calibration.notes = proto.notes();
  calibration.held.assign(proto.held().begin(), proto.held().end());
  return calibration;
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
      stored.mutable_camera_covariance()->mutable_packed()->Assign(packed.begin(), packed.end());
    }
    if (calibration.result) {
      for (const CameraResiduals& camera : calibration.result->residuals) {
        *stored.add_residuals() = ToProto(camera);
      }
    }
    if (calibration.result && calibration.result->information) {
      *stored.mutable_information() = ToProto(*calibration.result->information);
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
    const auto& packed = stored.camera_covariance().packed();
    calibration.result->camera_covariance.assign(packed.begin(), packed.end());
    for (const v1::CameraResiduals& camera : stored.residuals()) {
      calibration.result->residuals.push_back(FromProto(camera));
    }
    if (stored.has_information()) {
      calibration.result->information = FromProto(stored.information());
    }
  }
  return calibration;
}

}  // namespace rigcal::wire

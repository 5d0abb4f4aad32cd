// SPDX-License-Identifier: Apache-2.0
#include "server/worker/estimate_messages.h"

#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/wire/camera_wire.h"
#include "common/wire/observation_wire.h"
#include "server/worker/message_reader.h"

namespace rigcal::server {
namespace {

using wire::FromProto;
using wire::ToProto;

absl::Status EstimateCutOff(absl::string_view what) {
  return absl::DataLossError(absl::StrCat("the input of the estimate is damaged: ", what));
}

void Fill(const EstimateStart& start, worker::v1::EstimateStart* proto) {
  for (const EstimateStart::Camera& camera : start.cameras) {
    worker::v1::StartCamera* const out = proto->add_cameras();
    out->set_name(camera.name);
    *out->mutable_cam_from_rig() = ToProto(camera.cam_from_rig);
    *out->mutable_intrinsics() = ToProto(camera.intrinsics);
  }
  for (const ClockCorrection& clock : start.clocks) {
    worker::v1::StartClock* const out = proto->add_clocks();
    out->set_session_id(clock.session_id);
    out->set_clock_id(clock.clock_id);
    out->set_clock_epoch(clock.clock_epoch);
    out->set_time_epoch_ns(clock.time_epoch_ns);
    out->set_time_offset_s(clock.time_offset_s);
    out->set_time_rate(clock.time_rate);
  }
  proto->mutable_marker_positions_m()->Assign(start.marker_positions_m.begin(),
                                              start.marker_positions_m.end());
  proto->set_round(static_cast<uint32_t>(start.round));
}

absl::StatusOr<EstimateStart> Parse(const worker::v1::EstimateStart& proto) {
  EstimateStart start;
  for (const worker::v1::StartCamera& camera : proto.cameras()) {
    RIGCAL_ASSIGN_OR_RETURN(const RigidTransform cam_from_rig, FromProto(camera.cam_from_rig()));
    RIGCAL_ASSIGN_OR_RETURN(Intrinsics intrinsics, FromProto(camera.intrinsics()));
    start.cameras.push_back({camera.name(), cam_from_rig, std::move(intrinsics)});
  }
  for (const worker::v1::StartClock& clock : proto.clocks()) {
    start.clocks.push_back({clock.session_id(), clock.clock_id(), clock.clock_epoch(),
                            clock.time_epoch_ns(), clock.time_offset_s(), clock.time_rate()});
  }
  start.marker_positions_m.assign(proto.marker_positions_m().begin(),
                                  proto.marker_positions_m().end());
  start.round = static_cast<int>(proto.round());
  return start;
}

// Puts the parts of an input together.
class EstimateBuilder {
 public:
  bool complete() const { return ended_; }

  absl::Status Add(const worker::v1::EstimateInput& message) {
    if (ended_) return EstimateCutOff("something follows its end");
    switch (message.part_case()) {
      case worker::v1::EstimateInput::kHeader:
        return Begin(message.header());
      case worker::v1::EstimateInput::kRows: {
        if (message.rows().track() >= input_.tracks.size())
          return EstimateCutOff("rows of no camera");
        RIGCAL_ASSIGN_OR_RETURN(const ObservationBatch batch, FromProto(message.rows().batch()));
        AddRows(batch, &input_.tracks[message.rows().track()]);
        return absl::OkStatus();
      }
      case worker::v1::EstimateInput::kEnd:
        ended_ = true;
        return absl::OkStatus();
      default:
        return EstimateCutOff("a part of an unknown kind");
    }
  }

  RunningInput Take() { return std::move(input_); }

 private:
  absl::Status Begin(const worker::v1::EstimateHeader& header) {
    RIGCAL_ASSIGN_OR_RETURN(input_.target, FromProto(header.target()));
    for (const worker::v1::SolveTrack& proto : header.tracks()) {
      CameraTrack track;
      track.session_id = proto.session_id();
      RIGCAL_ASSIGN_OR_RETURN(track.camera, FromProto(proto.camera()));
      input_.tracks.push_back(std::move(track));
    }
    input_.data_share = header.data_share();
    RIGCAL_ASSIGN_OR_RETURN(input_.start, Parse(header.start()));
    return absl::OkStatus();
  }

  RunningInput input_;
  bool ended_ = false;
};

void Fill(const RunningEstimate& estimate, worker::v1::EstimateResult* proto) {
  proto->set_instant_count(static_cast<uint32_t>(estimate.instant_count));
  proto->set_intrinsics_refined(estimate.intrinsics_refined);
  proto->set_scale_known(estimate.scale_known);
  for (const EstimatedCamera& camera : estimate.cameras) {
    worker::v1::EstimateResultCamera* const out = proto->add_cameras();
    out->set_name(camera.name);
    *out->mutable_cam_from_rig() = ToProto(camera.cam_from_rig);
    out->set_time_offset_s(camera.time_offset_s);
    out->set_time_offset_sigma_s(camera.time_offset_sigma_s);
    out->set_reprojection_rms_px(camera.reprojection_rms_px);
    out->set_focal_length_px(camera.focal_length_px);
    out->set_lens_disagrees(camera.lens_disagrees);
  }
  proto->mutable_marker_positions_m()->Assign(estimate.marker_positions_m.begin(),
                                              estimate.marker_positions_m.end());
  proto->set_scale_sigma_rel(estimate.scale_sigma_rel);
  const WavedGrid& grid = estimate.grid;
  *proto->mutable_grid_origin_m() = ToProto(grid.origin_m);
  proto->set_grid_step_m(grid.step_m);
  for (const int count : grid.counts) proto->add_grid_counts(static_cast<uint32_t>(count));
  proto->mutable_wand_counts()->Assign(grid.wand_counts.begin(), grid.wand_counts.end());
  proto->mutable_sigma_m()->Resize(static_cast<int>(grid.size()), 0);
  const ExpectedError& error = estimate.error;
  for (size_t i = 0; i < error.points.size(); ++i) {
    proto->set_sigma_m(static_cast<int>(error.points[i]), static_cast<float>(error.sigma_m[i]));
  }
  proto->set_median_m(error.median_m);
  proto->set_p95_m(error.p95_m);
  proto->set_worst_m(error.worst_m);
  proto->set_worst_point(static_cast<uint32_t>(error.worst_point));
  proto->set_noise_median_m(error.noise_median_m);
  if (estimate.held_out) {
    proto->mutable_held_out()->set_rms_px(estimate.held_out->rms_px);
    proto->mutable_held_out()->set_expected_rms_px(estimate.held_out->expected_rms_px);
    proto->mutable_held_out()->set_agrees(estimate.held_out->agrees);
  }
  for (const WaveAdvice& advice : estimate.advice) {
    worker::v1::EstimateAdvice* const out = proto->add_advice();
    out->set_text(advice.text);
    *out->mutable_point_m() = ToProto(advice.point_m);
    *out->mutable_direction() = ToProto(advice.direction);
    for (const std::string& camera : advice.cameras) out->add_cameras(camera);
    out->set_expected_p95_m(advice.expected_p95_m);
  }
  for (const Eigen::Vector3d& marker : estimate.wand_m) *proto->add_wand_m() = ToProto(marker);
  Fill(estimate.next, proto->mutable_next());
}

absl::StatusOr<RunningEstimate> Parse(const worker::v1::EstimateResult& proto) {
  RunningEstimate estimate;
  estimate.instant_count = static_cast<int>(proto.instant_count());
  estimate.intrinsics_refined = proto.intrinsics_refined();
  estimate.scale_known = proto.scale_known();
  for (const worker::v1::EstimateResultCamera& camera : proto.cameras()) {
    RIGCAL_ASSIGN_OR_RETURN(const RigidTransform cam_from_rig, FromProto(camera.cam_from_rig()));
    estimate.cameras.push_back({camera.name(), cam_from_rig, camera.time_offset_s(),
                                camera.time_offset_sigma_s(), camera.reprojection_rms_px(),
                                camera.focal_length_px(), camera.lens_disagrees()});
  }
  estimate.marker_positions_m.assign(proto.marker_positions_m().begin(),
                                     proto.marker_positions_m().end());
  estimate.scale_sigma_rel = proto.scale_sigma_rel();
  WavedGrid& grid = estimate.grid;
  grid.origin_m = FromProto(proto.grid_origin_m());
  grid.step_m = proto.grid_step_m();
  uint64_t points = proto.grid_counts_size() == 3 ? 1 : 0;
  for (int i = 0; i < proto.grid_counts_size() && i < 3; ++i) {
    grid.counts[static_cast<size_t>(i)] = static_cast<int>(proto.grid_counts(i));
    points *= proto.grid_counts(i);
  }
  if (points != static_cast<uint64_t>(proto.wand_counts_size()) ||
      points != static_cast<uint64_t>(proto.sigma_m_size()) ||
      (points > 0 && proto.worst_point() >= points)) {
    return absl::InvalidArgumentError("the estimate's grid has another number of points");
  }
  grid.wand_counts.assign(proto.wand_counts().begin(), proto.wand_counts().end());
  grid.inside.assign(points, false);
  ExpectedError& error = estimate.error;
  for (size_t i = 0; i < points; ++i) {
    const float sigma_m = proto.sigma_m(static_cast<int>(i));
    if (!(sigma_m > 0)) continue;
    grid.inside[i] = true;
    error.points.push_back(i);
    error.sigma_m.push_back(sigma_m);
  }
  error.median_m = proto.median_m();
  error.p95_m = proto.p95_m();
  error.worst_m = proto.worst_m();
  error.worst_point = proto.worst_point();
  error.noise_median_m = proto.noise_median_m();
  if (proto.has_held_out()) {
    estimate.held_out = HeldOutCheck{proto.held_out().rms_px(), proto.held_out().expected_rms_px(),
                                     proto.held_out().agrees()};
  }
  for (const worker::v1::EstimateAdvice& advice : proto.advice()) {
    estimate.advice.push_back({advice.text(),
                               FromProto(advice.point_m()),
                               FromProto(advice.direction()),
                               {advice.cameras().begin(), advice.cameras().end()},
                               advice.expected_p95_m()});
  }
  for (const v1::Vector3& marker : proto.wand_m()) estimate.wand_m.push_back(FromProto(marker));
  RIGCAL_ASSIGN_OR_RETURN(estimate.next, Parse(proto.next()));
  return estimate;
}

}  // namespace

absl::Status EstimateInputWriter::Begin(const Target& target,
                                        const std::vector<CameraTrack>& tracks, double data_share,
                                        const EstimateStart& start) {
  worker::v1::EstimateHeader* const header = message_.mutable_header();
  *header->mutable_target() = ToProto(target);
  for (const CameraTrack& track : tracks) {
    worker::v1::SolveTrack* const out = header->add_tracks();
    out->set_session_id(track.session_id);
    *out->mutable_camera() = ToProto(track.camera);
  }
  header->set_data_share(data_share);
  Fill(start, header->mutable_start());
  return writer_.Write(message_);
}

absl::Status EstimateInputWriter::AddRows(size_t track, const ObservationBatch& batch) {
  message_.mutable_rows()->set_track(static_cast<uint32_t>(track));
  wire::ToProto(batch, message_.mutable_rows()->mutable_batch());
  return writer_.Write(message_);
}

absl::Status EstimateInputWriter::End() {
  message_.mutable_end();
  RIGCAL_RETURN_IF_ERROR(writer_.Write(message_));
  return writer_.Flush();
}

absl::StatusOr<RunningInput> ReadEstimateInput(int descriptor) {
  EstimateBuilder builder;
  worker::v1::EstimateInput message;
  RIGCAL_RETURN_IF_ERROR(ReadMessages(descriptor, &message, [&] { return builder.Add(message); }));
  if (!builder.complete()) return EstimateCutOff("it ends too early");
  return builder.Take();
}

worker::v1::EstimateOutput ToProto(const RunningOutcome& outcome) {
  worker::v1::EstimateOutput proto;
  proto.set_code(static_cast<uint32_t>(outcome.problem.code()));
  proto.set_message(std::string(outcome.problem.message()));
  for (const PairNeed& need : outcome.needs) {
    worker::v1::EstimatePairNeed* const out = proto.add_needs();
    out->set_camera_a(need.camera_a);
    out->set_camera_b(need.camera_b);
    out->set_common_count(static_cast<uint32_t>(need.common_count));
    out->set_needed_count(static_cast<uint32_t>(need.needed_count));
  }
  if (outcome.estimate) Fill(*outcome.estimate, proto.mutable_result());
  return proto;
}

absl::StatusOr<RunningOutcome> FromProto(const worker::v1::EstimateOutput& proto) {
  RunningOutcome outcome;
  outcome.problem = absl::Status(static_cast<absl::StatusCode>(proto.code()), proto.message());
  for (const worker::v1::EstimatePairNeed& need : proto.needs()) {
    outcome.needs.push_back({need.camera_a(), need.camera_b(),
                             static_cast<int>(need.common_count()),
                             static_cast<int>(need.needed_count())});
  }
  if (proto.has_result()) {
    RIGCAL_ASSIGN_OR_RETURN(outcome.estimate, Parse(proto.result()));
  }
  return outcome;
}

}  // namespace rigcal::server

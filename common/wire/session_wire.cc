// SPDX-License-Identifier: Apache-2.0
#include "common/wire/session_wire.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/status/validate_name.h"
#include "common/wire/camera_wire.h"
#include "common/wire/observation_wire.h"
#include "common/wire/time_wire.h"

namespace rigcal::wire {
namespace {

static_assert(static_cast<int>(SessionState::kCreated) == v1::Session::STATE_CREATED);
static_assert(static_cast<int>(SessionState::kCapturing) == v1::Session::STATE_CAPTURING);
static_assert(static_cast<int>(SessionState::kDraining) == v1::Session::STATE_DRAINING);
static_assert(static_cast<int>(SessionState::kFinished) == v1::Session::STATE_FINISHED);

void FillCounts(const SessionCameraCounts& counts, v1::SessionCamera* camera) {
  camera->set_observation_count(counts.observation_count);
  camera->set_wand_count(counts.wand_count);
  camera->set_late_count(counts.late_count);
  for (const ClockEpochCount& epoch : counts.clock_epochs) {
    v1::ClockEpochCount* out = camera->add_clock_epochs();
    out->set_clock_epoch(epoch.clock_epoch);
    out->set_observation_count(epoch.observation_count);
  }
  for (const StreamStatus& stream : counts.streams) {
    v1::StreamStatus* out = camera->add_streams();
    out->set_stream_epoch(stream.stream_epoch);
    out->set_durable_seq(stream.durable_seq);
    out->set_last_seq(stream.last_seq.value_or(0));
    out->set_ended(stream.ended());
  }
  for (const Refusal& refusal : counts.refused) *camera->add_refused() = ToProto(refusal);
  for (const Refusal& refusal : counts.refused) {
    if (refusal.reason == RefusalReason::kConflict) camera->set_conflict_count(refusal.count);
    if (refusal.reason == RefusalReason::kDamagedRecord) camera->set_damaged_count(refusal.count);
  }
  if (counts.frames) *camera->mutable_frames() = ToProto(*counts.frames);
  if (counts.detections) *camera->mutable_detections() = ToProto(*counts.detections);
  camera->set_ended(counts.ended());
}

v1::SessionGoal GoalToProto(const SessionGoal& goal) {
  v1::SessionGoal proto;
  proto.set_until_mm(goal.until_mm);
  *proto.mutable_min_duration() = ToDuration(goal.min_duration_s);
  return proto;
}

SessionGoal GoalFromProto(const v1::SessionGoal& proto) {
  SessionGoal goal;
  goal.until_mm = proto.until_mm();
  if (proto.has_min_duration()) goal.min_duration_s = SecondsOf(proto.min_duration());
  return goal;
}

// The fields that a session has of its own, without what the store counts.
v1::Session OwnFields(const Session& session) {
  v1::Session proto;
  proto.set_id(session.id);
  proto.set_rig(session.rig);
  proto.set_title(session.title);
  proto.set_state(static_cast<v1::Session::State>(session.state));
  *proto.mutable_target() = ToProto(session.target);
  for (const SessionCamera& camera : session.cameras) {
    v1::SessionCamera* out = proto.add_cameras();
    *out->mutable_description() = ToProto(camera.description);
    out->set_agent_id(camera.agent_id);
  }
  if (session.create_utc_ns) *proto.mutable_create_time() = ToTimestamp(session.create_utc_ns);
  if (session.start_utc_ns) *proto.mutable_start_time() = ToTimestamp(session.start_utc_ns);
  if (session.stop_utc_ns) *proto.mutable_stop_time() = ToTimestamp(session.stop_utc_ns);
  if (session.finish_utc_ns) *proto.mutable_finish_time() = ToTimestamp(session.finish_utc_ns);
  if (session.drain_deadline_utc_ns) {
    *proto.mutable_drain_deadline() = ToTimestamp(session.drain_deadline_utc_ns);
  }
  if (session.observations_delete_utc_ns) {
    *proto.mutable_observations_delete_time() = ToTimestamp(session.observations_delete_utc_ns);
  }
  for (const std::string& camera : session.missing_cameras) proto.add_missing_cameras(camera);
  for (const std::string& camera : session.requested_cameras) proto.add_requested_cameras(camera);
  if (session.goal) *proto.mutable_goal() = GoalToProto(*session.goal);
  proto.set_stop_reason(session.stop_reason);
  proto.set_continues(session.continues);
  if (session.discard_utc_ns) *proto.mutable_discard_time() = ToTimestamp(session.discard_utc_ns);
  return proto;
}

}  // namespace

v1::Session ToProto(const Session& session, const std::vector<SessionCameraCounts>& counts,
                    const std::vector<std::string>& connected_cameras) {
  v1::Session proto = OwnFields(session);
  proto.set_camera_count(static_cast<uint32_t>(session.cameras.size()));
  for (v1::SessionCamera& camera : *proto.mutable_cameras()) {
    const std::string& name = camera.description().camera();
    const auto found = std::ranges::find(counts, name, &SessionCameraCounts::camera);
    if (found != counts.end()) FillCounts(*found, &camera);
    proto.set_observation_count(proto.observation_count() + camera.observation_count());
    proto.set_wand_count(proto.wand_count() + camera.wand_count());
    proto.set_late_count(proto.late_count() + camera.late_count());
    camera.set_connected(std::ranges::find(connected_cameras, name) != connected_cameras.end());
  }
  return proto;
}

v1::Session ToProto(const SessionSummary& summary) {
  v1::Session proto = OwnFields(summary.session);
  proto.set_camera_count(summary.camera_count);
  proto.set_observation_count(summary.observation_count);
  proto.set_wand_count(summary.wand_count);
  proto.set_late_count(summary.late_count);
  proto.set_damage(summary.damage);
  return proto;
}

absl::StatusOr<Session> FromProto(const v1::CreateSessionRequest& proto) {
  Session session;
  session.id = proto.id();
  session.rig = proto.rig().empty() ? "rig" : proto.rig();
  session.title = proto.title();
  if (!proto.has_target()) {
    return absl::InvalidArgumentError("target: missing; give one such as wand:0,0.13,0.39");
  }
  RIGCAL_ASSIGN_OR_RETURN(session.target, FromProto(proto.target()));
  session.requested_cameras.assign(proto.camera_names().begin(), proto.camera_names().end());
  for (const v1::CameraDescription& camera : proto.cameras()) {
    RIGCAL_ASSIGN_OR_RETURN(CameraDescription description, FromProto(camera));
    session.cameras.push_back({std::move(description), ""});
  }
  if (proto.has_goal()) {
    RIGCAL_RETURN_IF_ERROR(CheckDuration(proto.goal().min_duration(), "goal.min_duration"));
    session.goal = GoalFromProto(proto.goal());
  }
  session.continues = proto.continues();
  return session;
}

std::string SerializeSession(const Session& session) {
  return OwnFields(session).SerializeAsString();
}

absl::StatusOr<Session> ParseSession(std::string_view bytes) {
  v1::Session proto;
  if (!proto.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) {
    return absl::DataLossError("a stored session cannot be read: its bytes are damaged");
  }
  Session session;
  session.id = proto.id();
  session.rig = proto.rig();
  session.title = proto.title();
  if (proto.state() < v1::Session::STATE_CREATED || proto.state() > v1::Session::STATE_FINISHED) {
    return absl::DataLossError(absl::StrCat("stored session ", session.id, " has no known state"));
  }
  session.state = static_cast<SessionState>(proto.state());
  RIGCAL_ASSIGN_OR_RETURN(session.target, FromProto(proto.target()));
  for (const v1::SessionCamera& camera : proto.cameras()) {
    RIGCAL_ASSIGN_OR_RETURN(CameraDescription description, FromProto(camera.description()));
    session.cameras.push_back({std::move(description), camera.agent_id()});
  }
  session.create_utc_ns = FromTimestamp(proto.create_time());
  session.start_utc_ns = FromTimestamp(proto.start_time());
  session.stop_utc_ns = FromTimestamp(proto.stop_time());
  session.finish_utc_ns = FromTimestamp(proto.finish_time());
  session.drain_deadline_utc_ns = FromTimestamp(proto.drain_deadline());
  session.observations_delete_utc_ns = FromTimestamp(proto.observations_delete_time());
  session.missing_cameras.assign(proto.missing_cameras().begin(), proto.missing_cameras().end());
  session.requested_cameras.assign(proto.requested_cameras().begin(),
                                   proto.requested_cameras().end());
  if (proto.has_goal()) session.goal = GoalFromProto(proto.goal());
  session.stop_reason = proto.stop_reason();
  session.continues = proto.continues();
  session.discard_utc_ns = FromTimestamp(proto.discard_time());
  return session;
}

}  // namespace rigcal::wire

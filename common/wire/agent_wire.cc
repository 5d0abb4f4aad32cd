// SPDX-License-Identifier: Apache-2.0
#include "common/wire/agent_wire.h"

#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/status/validate_name.h"
#include "common/text/printable.h"
#include "common/wire/camera_wire.h"
#include "common/wire/observation_wire.h"
#include "common/wire/protocol_version.h"
#include "common/wire/spool_wire.h"
#include "common/wire/time_wire.h"

namespace rigcal::wire {
namespace {

constexpr int kMaxPendingStreams = 4096;
constexpr size_t kMaxWordBytes = 256;

absl::Status InField(absl::string_view field, const absl::Status& status) {
  return absl::Status(status.code(), absl::StrCat(field, ": ", status.message()));
}

absl::Status CheckWord(absl::string_view field, const std::string& word) {
  if (word.size() <= kMaxWordBytes) {
    const std::string shown = Printable(word);
    if (shown == word) return absl::OkStatus();
    return absl::InvalidArgumentError(
        absl::StrCat(field, ": \"", shown, "\" has control characters"));
  }
  return absl::InvalidArgumentError(absl::StrCat(field, ": has ", word.size(), " bytes, at most ",
                                                 kMaxWordBytes, " are allowed"));
}

}  // namespace

absl::StatusOr<AgentHello> FromProto(const v1::AgentHello& proto) {
  if (absl::Status status = ValidateName("agent id", proto.agent_id()); !status.ok()) {
    return InField("hello.agent_id", status);
  }
  RIGCAL_RETURN_IF_ERROR(CheckProtocolVersion(absl::StrCat("agent '", proto.agent_id(), "'"),
                                              proto.protocol_version()));
  if (absl::Status status = ValidateName("rig name", proto.rig()); !status.ok()) {
    return InField("hello.rig", status);
  }
  RIGCAL_RETURN_IF_ERROR(CheckWord("hello.host", proto.host()));
  RIGCAL_RETURN_IF_ERROR(CheckWord("hello.software_version", proto.software_version()));
  RIGCAL_RETURN_IF_ERROR(CheckWord("hello.installation_secret", proto.installation_secret()));
  AgentHello hello;
  hello.agent.agent_id = proto.agent_id();
  hello.agent.incarnation = proto.incarnation();
  hello.agent.connection = proto.connection();
  hello.agent.host = proto.host();
  hello.agent.software_version = proto.software_version();
  hello.agent.rig = proto.rig();
  hello.secret = proto.installation_secret();
  hello.agent.spool_survives_restart = proto.spool_survives_restart();
  RIGCAL_RETURN_IF_ERROR(CheckWord("hello.known_server_id", proto.known_server_id()));
  hello.keeps_until_standby = proto.keeps_until_standby();
  hello.known_server_id = proto.known_server_id();
  hello.known_generation = proto.known_generation();
  hello.known_generation_proof = proto.known_generation_proof();
  for (int i = 0; i < proto.cameras_size(); ++i) {
    const v1::AnnouncedCamera& camera = proto.cameras(i);
    const std::string field = absl::StrCat("hello.cameras[", i, "]");
    if (camera.stream_epoch() == 0) {
      return absl::InvalidArgumentError(absl::StrCat(field, ".stream_epoch: must be at least 1"));
    }
    absl::StatusOr<CameraDescription> description = FromProto(camera.description());
    if (!description.ok()) return InField(field + ".description", description.status());
    hello.agent.cameras.push_back({*std::move(description), camera.stream_epoch()});
  }
  if (proto.pending_size() > kMaxPendingStreams) {
    return absl::InvalidArgumentError(absl::StrCat("hello.pending: has ", proto.pending_size(),
                                                   " streams, at most ", kMaxPendingStreams,
                                                   " are allowed"));
  }
  for (int i = 0; i < proto.pending_size(); ++i) {
    absl::StatusOr<StreamKey> stream = FromProto(proto.pending(i));
    if (!stream.ok()) return InField(absl::StrCat("hello.pending[", i, "]"), stream.status());
    hello.pending.push_back(*std::move(stream));
  }
  return hello;
}

v1::StreamPosition ToProto(const StreamPosition& position) {
  v1::StreamPosition proto;
  *proto.mutable_stream() = ToProto(position.stream);
  proto.set_durable_seq(position.durable_seq);
  proto.set_send_limit_seq(position.send_limit_seq);
  proto.set_unknown(position.unknown);
  return proto;
}

v1::StartCapture ToProto(const StartCaptureCommand& command) {
  v1::StartCapture proto;
  proto.set_session_id(command.session_id);
  *proto.mutable_target() = ToProto(command.target);
  for (const StreamPosition& camera : command.cameras) *proto.add_cameras() = ToProto(camera);
  return proto;
}

v1::Agent ToProto(const AgentRecord& agent) {
  v1::Agent proto;
  proto.set_agent_id(agent.agent_id);
  proto.set_host(agent.host);
  proto.set_rig(agent.rig);
  proto.set_incarnation(agent.incarnation);
  proto.set_connection(agent.connection);
  proto.set_software_version(agent.software_version);
  proto.set_connected(agent.connected);
  *proto.mutable_connect_time() = ToTimestamp(agent.connect_utc_ns);
  if (agent.disconnect_utc_ns != 0) {
    *proto.mutable_disconnect_time() = ToTimestamp(agent.disconnect_utc_ns);
  }
  for (const AnnouncedCamera& camera : agent.cameras) {
    *proto.add_cameras() = ToProto(camera.description);
  }
  if (agent.spool) *proto.mutable_spool() = ToProto(*agent.spool);
  return proto;
}

}  // namespace rigcal::wire

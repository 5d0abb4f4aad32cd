// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/agent_messages.h"

#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/camera/camera_id.h"
#include "common/status/status_macros.h"
#include "common/wire/camera_wire.h"
#include "common/wire/observation_wire.h"
#include "common/wire/protocol_version.h"
#include "common/wire/timestamp_wire.h"

namespace rigcal::server {
namespace {

constexpr int kMaxPendingStreams = 4096;
constexpr size_t kMaxWordBytes = 256;
constexpr uint32_t kFirstMinorWithPreviews = 1;

absl::Status InField(absl::string_view field, const absl::Status& status) {
  return absl::Status(status.code(), absl::StrCat(field, ": ", status.message()));
}

absl::Status CheckWord(absl::string_view field, const std::string& word) {
  if (word.size() <= kMaxWordBytes) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(field, ": has ", word.size(), " bytes, at most ",
                                                 kMaxWordBytes, " are allowed"));
}

absl::Status TakeEnd(const v1::EndOfCapture& proto, Delivery* delivery) {
  RIGCAL_ASSIGN_OR_RETURN(EndOfCapture end, wire::FromProto(proto));
  delivery->batch.stream = std::move(end.stream);
  delivery->last_seq = end.last_seq;
  delivery->report = std::move(end.report);
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<Hello> ParseHello(const v1::AgentHello& proto) {
  if (absl::Status status = ValidateName("agent id", proto.agent_id()); !status.ok()) {
    return InField("hello.agent_id", status);
  }
  RIGCAL_RETURN_IF_ERROR(wire::CheckProtocolVersion(absl::StrCat("agent '", proto.agent_id(), "'"),
                                                    proto.protocol_version()));
  if (absl::Status status = ValidateName("rig name", proto.rig()); !status.ok()) {
    return InField("hello.rig", status);
  }
  RIGCAL_RETURN_IF_ERROR(CheckWord("hello.host", proto.host()));
  RIGCAL_RETURN_IF_ERROR(CheckWord("hello.software_version", proto.software_version()));
  Hello hello;
  hello.agent.agent_id = proto.agent_id();
  hello.agent.incarnation = proto.incarnation();
  hello.agent.connection = proto.connection();
  hello.agent.host = proto.host();
  hello.agent.software_version = proto.software_version();
  hello.agent.rig = proto.rig();
  hello.agent.takes_preview_requests = proto.protocol_version().minor() >= kFirstMinorWithPreviews;
  for (int i = 0; i < proto.cameras_size(); ++i) {
    const v1::AnnouncedCamera& camera = proto.cameras(i);
    const std::string field = absl::StrCat("hello.cameras[", i, "]");
    if (camera.stream_epoch() == 0) {
      return absl::InvalidArgumentError(absl::StrCat(field, ".stream_epoch: must be at least 1"));
    }
    absl::StatusOr<CameraDescription> description = wire::FromProto(camera.description());
    if (!description.ok()) return InField(field + ".description", description.status());
    hello.agent.cameras.push_back({*std::move(description), camera.stream_epoch()});
  }
  if (proto.pending_size() > kMaxPendingStreams) {
    return absl::InvalidArgumentError(absl::StrCat("hello.pending: has ", proto.pending_size(),
                                                   " streams, at most ", kMaxPendingStreams,
                                                   " are allowed"));
  }
  for (int i = 0; i < proto.pending_size(); ++i) {
    absl::StatusOr<StreamKey> stream = wire::FromProto(proto.pending(i));
    if (!stream.ok()) return InField(absl::StrCat("hello.pending[", i, "]"), stream.status());
    hello.pending.push_back(*std::move(stream));
  }
  return hello;
}

absl::StatusOr<Delivery> ParseDelivery(const v1::ObservationBatch& proto, uint32_t max_rows) {
  if (static_cast<uint32_t>(proto.time_ns_size()) > max_rows) {
    return absl::InvalidArgumentError(absl::StrCat("batch.time_ns: has ", proto.time_ns_size(),
                                                   " rows, at most ", max_rows, " are allowed"));
  }
  Delivery delivery;
  RIGCAL_ASSIGN_OR_RETURN(delivery.batch, wire::FromProto(proto));
  return delivery;
}

absl::StatusOr<Delivery> ParseDelivery(const v1::EndOfCapture& proto) {
  Delivery delivery;
  RIGCAL_RETURN_IF_ERROR(TakeEnd(proto, &delivery));
  return delivery;
}

absl::StatusOr<Delivery> ParseDelivery(const v1::CameraReport& proto) {
  Delivery delivery;
  RIGCAL_ASSIGN_OR_RETURN(delivery.report, wire::FromProto(proto));
  delivery.batch.stream = delivery.report->stream;
  return delivery;
}

absl::StatusOr<Delivery> ParseDelivery(const v1::UploadBatchRequest& proto, uint32_t max_rows) {
  if (!proto.has_batch() && !proto.has_end_of_capture()) {
    return absl::InvalidArgumentError("batch: neither batch nor end_of_capture is set");
  }
  if (!proto.has_batch()) return ParseDelivery(proto.end_of_capture());
  RIGCAL_ASSIGN_OR_RETURN(Delivery delivery, ParseDelivery(proto.batch(), max_rows));
  if (proto.has_end_of_capture()) {
    const StreamKey stream = delivery.stream();
    RIGCAL_RETURN_IF_ERROR(TakeEnd(proto.end_of_capture(), &delivery));
    if (delivery.stream() != stream) {
      return absl::InvalidArgumentError(
          "end_of_capture: is of another session, camera or stream_epoch than batch");
    }
  }
  return delivery;
}

v1::StreamPosition ToProto(const StreamPosition& position) {
  v1::StreamPosition proto;
  *proto.mutable_stream() = wire::ToProto(position.stream);
  proto.set_durable_seq(position.durable_seq);
  proto.set_send_limit_seq(position.send_limit_seq);
  proto.set_unknown(position.unknown);
  return proto;
}

v1::StartCapture ToProto(const StartCaptureCommand& command) {
  v1::StartCapture proto;
  proto.set_session_id(command.session_id);
  *proto.mutable_target() = wire::ToProto(command.target);
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
  *proto.mutable_connect_time() = wire::ToTimestamp(agent.connect_utc_ns);
  if (agent.disconnect_utc_ns != 0) {
    *proto.mutable_disconnect_time() = wire::ToTimestamp(agent.disconnect_utc_ns);
  }
  for (const AnnouncedCamera& camera : agent.cameras) {
    *proto.add_cameras() = wire::ToProto(camera.description);
  }
  return proto;
}

}  // namespace rigcal::server

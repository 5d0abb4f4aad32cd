// SPDX-License-Identifier: Apache-2.0
// What the server says, and what the uplink does about it; the other half of uplink.cc.
#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/uplink/host_alignment.h"
#include "agent/uplink/uplink.h"
#include "agent/uplink/uplink_connection.h"
#include "common/wire/camera_wire.h"
#include "common/wire/observation_wire.h"
#include "common/wire/preview_wire.h"
#include "common/wire/protocol_version.h"

namespace rigcal::agent {
namespace {

// Rows that fit the server's limits whatever the number of markers.
size_t BatchRows(size_t wanted, const v1::ServerHello& hello) {
  constexpr size_t kRowBytes = 13 + 29 * kMaxMarkers;
  constexpr size_t kOtherBytes = size_t{16} * 1024;
  size_t rows = wanted;
  if (hello.max_batch_observations() > 0) {
    rows = std::min<size_t>(rows, hello.max_batch_observations());
  }
  if (hello.max_message_bytes() > 0) {
    const size_t bytes = std::max<size_t>(hello.max_message_bytes(), kOtherBytes) - kOtherBytes;
    rows = std::min(rows, bytes / kRowBytes);
  }
  return std::max<size_t>(rows, 1);
}

}  // namespace

void Uplink::Handle(Connected& connected, const v1::ServerMessage& message) {
  connected.last_heard = Clock::now();
  if (!connected.greeted && message.message_case() != v1::ServerMessage::kHello) {
    connected.fault = absl::InternalError("the server spoke before its hello");
    return;
  }
  switch (message.message_case()) {
    case v1::ServerMessage::kHello:
      return HandleHello(connected, message.hello());
    case v1::ServerMessage::kStartCapture:
      return HandleStartCapture(message.start_capture());
    case v1::ServerMessage::kStopCapture:
      return HandleStopCapture(message.stop_capture());
    case v1::ServerMessage::kAck:
      return HandleAck(connected, message.ack());
    case v1::ServerMessage::kTimePong:
      return HandlePong(connected, message.time_pong());
    case v1::ServerMessage::kPreviewRequest:
      return HandlePreviewRequest(message.preview_request());
    case v1::ServerMessage::MESSAGE_NOT_SET:
      // A server one minor version newer may say things that are not known here.
      spdlog::debug("server {}: a message of a kind that is not known here", options_.server);
  }
}

void Uplink::HandleHello(Connected& connected, const v1::ServerHello& hello) {
  if (connected.greeted) {
    connected.fault = absl::InternalError("the server sent two hellos");
    return;
  }
  connected.fault = wire::CheckProtocolVersion(absl::StrCat("server ", options_.server),
                                               hello.protocol_version());
  if (!connected.fault.ok()) return;
  if (static_cast<size_t>(hello.positions_size()) != pending_.size()) {
    connected.fault =
        absl::InternalError(absl::StrCat("the server's hello gives ", hello.positions_size(),
                                         " positions for ", pending_.size(), " pending streams"));
    return;
  }
  if (!server_id_.empty() && server_id_ != hello.server_id()) {
    spdlog::warn(
        "server {}: its store is another one now ({}, was {}); what only the old one had "
        "is not sent again",
        options_.server, hello.server_id(), server_id_);
  }
  server_id_ = hello.server_id();
  connected.greeted = true;
  last_error_.clear();
  spdlog::info("server {}: connected as {} (incarnation {}, connection {})", options_.server,
               options_.agent_id, options_.incarnation, connection_);
  live_sessions_.clear();
  plan_.BeginConnection(BatchRows(options_.max_batch_rows, hello));
  for (int i = 0; i < hello.positions_size(); ++i) {
    HandlePosition(pending_[static_cast<size_t>(i)], hello.positions(i));
  }
}

void Uplink::HandlePreviewRequest(const v1::PreviewRequest& request) {
  const absl::StatusOr<PreviewRequest> asked = wire::FromProto(request);
  if (!asked.ok()) {
    spdlog::warn("server {}: a request for a preview is refused: {}", options_.server,
                 std::string(asked.status().message()));
    return;
  }
  previews_->Request(*asked, captures_->PreviewSubjectOf(asked->camera));
}

void Uplink::HandlePosition(const StreamKey& stream, const v1::StreamPosition& position) {
  if (!position.unknown()) {
    plan_.SetPosition(stream, position.durable_seq(), position.send_limit_seq());
    return;
  }
  captures_->EndStream(stream);
  const uint32_t lost = plan_.Discard(stream);
  spdlog::warn(
      "camera {}: the server no longer takes session {} (deleted, or without this camera); "
      "{} observations are dropped",
      stream.camera, stream.session_id, lost);
}

void Uplink::HandleStartCapture(const v1::StartCapture& command) {
  const absl::StatusOr<Target> target = wire::FromProto(command.target());
  if (!target.ok()) {
    spdlog::error("server {}: the target of session {} is refused: {}", options_.server,
                  command.session_id(), std::string(target.status().message()));
    return;
  }
  live_sessions_.insert(command.session_id());
  for (const v1::StreamPosition& position : command.cameras()) {
    const absl::StatusOr<StreamKey> stream = wire::FromProto(position.stream());
    if (!stream.ok() || stream->session_id != command.session_id()) {
      spdlog::error("server {}: a camera of session {} is refused: {}", options_.server,
                    command.session_id(), stream.status().ToString());
      continue;
    }
    if (position.unknown()) {
      HandlePosition(*stream, position);
      continue;
    }
    if (!plan_.Knows(*stream)) BeginCapture(*stream, *target, position.durable_seq());
    plan_.SetPosition(*stream, position.durable_seq(), position.send_limit_seq());
  }
}

void Uplink::BeginCapture(const StreamKey& stream, const Target& target, uint32_t durable_seq) {
  if (stream.stream_epoch != options_.stream_epoch) {
    spdlog::warn("camera {}: session {} asks for stream epoch {}, but what is captured now is {}",
                 stream.camera, stream.session_id, stream.stream_epoch, options_.stream_epoch);
    return;
  }
  for (const std::string& session_id : captures_->SessionsOf(stream.camera)) {
    if (live_sessions_.contains(session_id)) continue;
    spdlog::warn(
        "camera {}: session {} has ended while the server was away; its capture ends, and "
        "session {} follows",
        stream.camera, session_id, stream.session_id);
    captures_->EndStream({.session_id = session_id, .camera = stream.camera});
  }
  // Numbers of an earlier life that had lost its state: under the same ones, what is captured now
  // would be taken for a repetition.
  if (durable_seq > 0) {
    spdlog::warn(
        "camera {}: the server already has {} observations of session {} from this agent; "
        "new ones are numbered after them",
        stream.camera, durable_seq, stream.session_id);
  }
  if (const absl::Status status = captures_->Begin(stream, target, durable_seq + 1); !status.ok()) {
    spdlog::error("camera {}: the capture for session {} cannot begin: {}", stream.camera,
                  stream.session_id, std::string(status.message()));
  }
}

void Uplink::HandleStopCapture(const v1::StopCapture& command) {
  spdlog::info("server {}: session {} stops", options_.server, command.session_id());
  live_sessions_.erase(command.session_id());
  captures_->End(command.session_id());
}

void Uplink::HandleAck(Connected& connected, const v1::BatchAck& proto) {
  const absl::StatusOr<BatchAck> ack = wire::FromProto(proto);
  if (!ack.ok()) {
    connected.fault = absl::InternalError(
        absl::StrCat("an acknowledgement is malformed: ", std::string(ack.status().message())));
    return;
  }
  if (ack->fault_count > 0) {
    const ObservationFault first = ack->faults.empty() ? ObservationFault{} : ack->faults.front();
    spdlog::warn(
        "camera {}: the server refused {} observations of session {}, first: number {}, "
        "{}: {}",
        ack->stream.camera, ack->fault_count, ack->stream.session_id, first.seq, first.field,
        first.reason);
  }
  if (plan_.Acknowledge(*ack)) connected.progressed = true;
}

void Uplink::HandlePong(Connected& connected, const v1::TimePong& pong) {
  // One that belongs to no ping would shift the clocks.
  if (connected.ping_ns != pong.host_monotonic_ns()) return;
  connected.ping_ns.reset();
  plan_.AddAlignment(
      AlignHost(pong.host_monotonic_ns(), pong.server_utc_ns(), MonotonicNowNs(), UtcNowNs()));
}

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
#include "agent/uplink/conversation.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "agent/capture/device_clock.h"
#include "agent/uplink/host_alignment.h"
#include "common/status/status_macros.h"
#include "common/wire/camera_wire.h"
#include "common/wire/detector_wire.h"
#include "common/wire/observation_wire.h"
#include "common/wire/offer_wire.h"
#include "common/wire/preview_wire.h"
#include "common/wire/protocol_version.h"
#include "common/wire/spool_wire.h"

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

// Totals only grow, and so does their sum.
uint64_t CountedIn(const CameraReport& report) {
  uint64_t sum = 0;
  for (const Refusal& refusal : report.refused) sum += refusal.count;
  if (const auto& frames = report.frames) {
    sum += frames->received + frames->damaged + frames->lost + frames->reconnects;
  }
  if (const auto& spool = report.spool) {
    sum += uint64_t{spool->last_seq} + spool->acknowledged_seq;
    for (const Refusal& refusal : spool->dropped) sum += refusal.count;
  }
  return sum;
}

}  // namespace

v1::ConnectRequest Conversation::Hello() {
  v1::ConnectRequest message;
  v1::AgentHello* hello = message.mutable_hello();
  *hello->mutable_protocol_version() = wire::OwnProtocolVersion();
  hello->set_software_version(std::string(wire::kSoftwareVersion));
  hello->set_agent_id(options_.agent_id);
  hello->set_incarnation(options_.incarnation);
  hello->set_connection(connection_);
  hello->set_host(options_.host);
  hello->set_rig(options_.rig);
  hello->set_installation_secret(options_.secret);
  for (const auto& [name, pipeline] : *agent_.cameras) {
    v1::AnnouncedCamera* announced = hello->add_cameras();
    *announced->mutable_description() = wire::ToProto(pipeline->description());
    announced->set_stream_epoch(options_.stream_epoch);
  }
  for (const SpooledStream& spooled : agent_.spool->Streams()) {
    pending_.push_back(spooled.stream);
    *hello->add_pending() = wire::ToProto(spooled.stream);
  }
  hello->set_spool_survives_restart(agent_.spool->survives_restart());
  hello->set_keeps_until_standby(options_.keeps_until_standby);
  if (agent_.known_servers != nullptr) {
    const KnownServers::Server known = agent_.known_servers->Last();
    hello->set_known_server_id(known.id);
    hello->set_known_generation(known.generation);
    hello->set_known_generation_proof(known.proof);
  }
  return message;
}

absl::Status Conversation::Handle(const v1::ConnectResponse& message, Clock::time_point now) {
  last_heard_ = now;
  if (!greeted_ && message.message_case() != v1::ConnectResponse::kHello) {
    return absl::InternalError("the server sent a message before its hello");
  }
  switch (message.message_case()) {
    case v1::ConnectResponse::kHello:
      return HandleHello(message.hello());
    case v1::ConnectResponse::kAck:
      return HandleAck(message.ack(), now);
    case v1::ConnectResponse::kStartCapture:
      HandleStartCapture(message.start_capture());
      break;
    case v1::ConnectResponse::kStopCapture:
      spdlog::info("server {}: session {} stops", server_, message.stop_capture().session_id());
      live_sessions_.erase(message.stop_capture().session_id());
      for (const auto& [name, pipeline] : *agent_.cameras) {
        pipeline->End(message.stop_capture().session_id());
      }
      break;
    case v1::ConnectResponse::kTimePong:
      HandlePong(message.time_pong());
      break;
    case v1::ConnectResponse::kPreviewRequest:
      HandlePreviewRequest(message.preview_request());
      break;
    case v1::ConnectResponse::kDetectorRequest:
      HandleDetectorRequest(message.detector_request());
      break;
    case v1::ConnectResponse::kChoiceRequest:
      HandleChoiceRequest(message.choice_request());
      break;
    case v1::ConnectResponse::MESSAGE_NOT_SET:
      // A server one minor version newer may send kinds that are not known here.
      spdlog::debug("server {}: a message of a kind that is not known here", server_);
  }
  return absl::OkStatus();
}

absl::Status Conversation::HandleHello(const v1::ServerHello& hello) {
  if (greeted_) return absl::InternalError("the server sent two hellos");
  RIGCAL_RETURN_IF_ERROR(
      wire::CheckProtocolVersion(absl::StrCat("server ", server_), hello.protocol_version()));
  if (static_cast<size_t>(hello.positions_size()) != pending_.size()) {
    return absl::InternalError(absl::StrCat("the server's hello gives ", hello.positions_size(),
                                            " positions for ", pending_.size(),
                                            " pending streams"));
  }
  if (agent_.known_servers != nullptr) {
    RIGCAL_RETURN_IF_ERROR(
        agent_.known_servers->Meet(server_, {.id = hello.server_id(),
                                             .generation = hello.generation(),
                                             .proof = hello.generation_proof()}));
  }
  if (!agent_.server_id.empty() && agent_.server_id != hello.server_id()) {
    spdlog::warn(
        "server {}: its store has changed ({}, was {}); observations that only the old one had "
        "are not sent again",
        server_, hello.server_id(), agent_.server_id);
  }
  agent_.server_id = hello.server_id();
  greeted_ = true;
  takes_offers_ = hello.takes_offers();
  servers_.assign(hello.servers().begin(), hello.servers().end());
  spdlog::info("server {}: connected as {} (incarnation {}, connection {})", server_,
               options_.agent_id, options_.incarnation, connection_);
  agent_.plan->BeginConnection(BatchRows(options_.max_batch_rows, hello));
  for (int i = 0; i < hello.positions_size(); ++i) {
    HandlePosition(pending_[static_cast<size_t>(i)], hello.positions(i));
  }
  return absl::OkStatus();
}

void Conversation::HandlePreviewRequest(const v1::PreviewRequest& request) {
  const absl::StatusOr<PreviewRequest> asked = wire::FromProto(request);
  if (!asked.ok()) {
    spdlog::warn("server {}: a request for a preview is refused: {}", server_,
                 std::string(asked.status().message()));
    return;
  }
  PreviewSubject subject;
  if (CameraPipeline* const pipeline = PipelineOf(asked->camera)) {
    subject = {
        .known = true, .capturing = !pipeline->Sessions().empty(), .tap = pipeline->preview_tap()};
  }
  agent_.previews->Request(*asked, subject);
}

void Conversation::HandleDetectorRequest(const v1::DetectorRequest& request) {
  absl::StatusOr<DetectorRequest> asked = wire::FromProto(request);
  if (!asked.ok()) {
    spdlog::warn("server {}: a request about a detector is refused: {}", server_,
                 std::string(asked.status().message()));
    return;
  }
  agent_.detectors->Request(*std::move(asked));
}

void Conversation::HandleChoiceRequest(const v1::ChoiceRequest& request) {
  absl::StatusOr<ChoiceRequest> asked = wire::FromProto(request);
  if (!asked.ok()) {
    spdlog::warn("server {}: a choice of a camera is refused: {}", server_,
                 std::string(asked.status().message()));
    return;
  }
  if (agent_.offers != nullptr) agent_.offers->Request(*std::move(asked));
}

std::optional<v1::ConnectRequest> Conversation::NextOffer() {
  if (agent_.offers == nullptr || !takes_offers_) return std::nullopt;
  v1::ConnectRequest message;
  // Before the answer, so that who has it finds the camera in its new state.
  if (const auto offer = agent_.offers->TakeOffer()) {
    *message.mutable_offer() = wire::ToProto(*offer);
    return message;
  }
  if (const auto answer = agent_.offers->TakeAnswer()) {
    *message.mutable_choice_answer() = wire::ToProto(*answer);
    return message;
  }
  return std::nullopt;
}

void Conversation::HandlePosition(const StreamKey& stream, const v1::StreamPosition& position) {
  if (!position.unknown()) {
    agent_.plan->SetPosition(stream, position.durable_seq(), position.send_limit_seq());
    return;
  }
  if (CameraPipeline* const pipeline = PipelineOf(stream.camera)) pipeline->End(stream.session_id);
  const uint32_t lost = agent_.plan->Discard(stream);
  spdlog::warn(
      "camera {}: the server does not accept session {} any more (deleted, without this "
      "camera, or not copied by a standby that took over); {} observations are dropped",
      stream.camera, stream.session_id, lost);
}

void Conversation::HandleStartCapture(const v1::StartCapture& command) {
  const absl::StatusOr<Target> target = wire::FromProto(command.target());
  if (!target.ok()) {
    spdlog::error("server {}: the target of session {} is refused: {}", server_,
                  command.session_id(), std::string(target.status().message()));
    return;
  }
  live_sessions_.insert(command.session_id());
  for (const v1::StreamPosition& position : command.cameras()) {
    const absl::StatusOr<StreamKey> stream = wire::FromProto(position.stream());
    if (!stream.ok() || stream->session_id != command.session_id()) {
      spdlog::error("server {}: a camera of session {} is refused: {}", server_,
                    command.session_id(), stream.status().ToString());
      continue;
    }
    if (position.unknown()) {
      HandlePosition(*stream, position);
      continue;
    }
    if (!agent_.plan->Knows(*stream)) BeginCapture(*stream, *target, position.durable_seq());
    agent_.plan->SetPosition(*stream, position.durable_seq(), position.send_limit_seq());
  }
}

void Conversation::BeginCapture(const StreamKey& stream, const Target& target,
                                uint32_t durable_seq) {
  if (stream.stream_epoch != options_.stream_epoch) {
    spdlog::warn("camera {}: session {} asks for stream epoch {}, but this agent captures epoch {}",
                 stream.camera, stream.session_id, stream.stream_epoch, options_.stream_epoch);
    return;
  }
  CameraPipeline* const pipeline = PipelineOf(stream.camera);
  if (pipeline == nullptr) {
    spdlog::error("camera {}: session {} asks for it, but this agent has no such camera",
                  stream.camera, stream.session_id);
    return;
  }
  if (agent_.plan->HasEndedBefore(stream)) {
    // Before this run, while the server was not connected. It waits for the end of this stream too.
    spdlog::info("camera {}: its capture for session {} ended before this start of the agent",
                 stream.camera, stream.session_id);
    absl::Status status = agent_.spool->Open(stream, target.marker_count(), durable_seq + 1);
    if (status.ok()) status = agent_.spool->Finish(stream, {});
    if (!status.ok()) spdlog::error("camera {}: {}", stream.camera, std::string(status.message()));
    return;
  }
  for (const std::string& session_id : pipeline->Sessions()) {
    if (live_sessions_.contains(session_id)) continue;
    spdlog::warn(
        "camera {}: session {} ended while the server was not connected; its capture ends, and "
        "session {} follows",
        stream.camera, session_id, stream.session_id);
    pipeline->End(session_id);
  }
  // Sent by an earlier run that has lost its state. With the same numbers again, new observations
  // would count as repeated ones.
  if (durable_seq > 0) {
    spdlog::warn(
        "camera {}: the server already has {} observations of session {} from this agent; "
        "new ones are numbered after them",
        stream.camera, durable_seq, stream.session_id);
  }
  if (const absl::Status status = pipeline->Begin(stream, target, durable_seq + 1); !status.ok()) {
    spdlog::error("camera {}: the capture for session {} cannot begin: {}", stream.camera,
                  stream.session_id, std::string(status.message()));
  }
}

absl::Status Conversation::HandleAck(const v1::BatchAck& proto, Clock::time_point now) {
  const absl::StatusOr<BatchAck> ack = wire::FromProto(proto);
  if (!ack.ok()) {
    return absl::InternalError(
        absl::StrCat("an acknowledgement is malformed: ", std::string(ack.status().message())));
  }
  if (ack->fault_count > 0) {
    const ObservationFault first = ack->faults.empty() ? ObservationFault{} : ack->faults.front();
    spdlog::warn(
        "camera {}: the server refused {} observations of session {}, first: number {}, "
        "{}: {}",
        ack->stream.camera, ack->fault_count, ack->stream.session_id, first.seq, first.field,
        NameOf(first.reason));
  }
  if (ack->conflict_count > 0) {
    spdlog::error(
        "camera {}: the server has {} observations of session {} with other values than this agent "
        "sent under their numbers, and keeps those; does another agent use the same state "
        "directory, or a copy of it?",
        ack->stream.camera, ack->conflict_count, ack->stream.session_id);
  }
  if (agent_.plan->Acknowledge(*ack, now)) progressed_ = true;
  return absl::OkStatus();
}

void Conversation::HandlePong(const v1::TimePong& pong) {
  // One that belongs to no ping would shift the clocks.
  if (ping_ns_ != pong.host_monotonic_ns()) return;
  ping_ns_.reset();
  agent_.plan->AddAlignment(
      AlignHost(pong.host_monotonic_ns(), pong.server_utc_ns(), MonotonicNowNs(), UtcNowNs()));
}

std::optional<v1::ConnectRequest> Conversation::Next(Clock::time_point now) {
  v1::ConnectRequest message;
  if (now >= next_ping_) {
    next_ping_ = now + options_.ping_interval;
    ping_ns_ = MonotonicNowNs();
    message.mutable_time_ping()->set_host_monotonic_ns(*ping_ns_);
    *message.mutable_time_ping()->mutable_spool() = wire::ToProto(agent_.spool->Status());
    return message;
  }
  if (now - start_ >= options_.alignment_timeout) agent_.plan->StopWaitingForAlignment();
  if (now >= next_report_ && !agent_.plan->SendsOneAtATime()) {
    next_report_ = now + options_.report_interval;
    to_report_ = agent_.spool->Streams();
  }
  if (auto report = NextReport()) return report;
  // Small, rare, and somebody waits for it.
  if (const std::optional<DetectorAnswer> answer = agent_.detectors->TakeAnswer()) {
    *message.mutable_detector_answer() = wire::ToProto(*answer);
    return message;
  }
  if (auto offer = NextOffer()) return offer;
  std::optional<DeliveryPlan::Message> next = agent_.plan->Next(now);
  if (!next) {
    // Only when there is nothing else to send.
    std::optional<Preview> preview = agent_.previews->TakeAnswer();
    if (!preview) return std::nullopt;
    *message.mutable_preview() = wire::ToProto(*std::move(preview));
    return message;
  }
  if (const auto* batch = std::get_if<ObservationBatch>(&*next)) {
    wire::ToProto(*batch, message.mutable_batch());
  } else {
    *message.mutable_end_of_capture() = wire::ToProto(std::get<EndOfCapture>(*next));
  }
  return message;
}

std::optional<v1::ConnectRequest> Conversation::NextReport() {
  while (!to_report_.empty()) {
    const SpooledStream spooled = std::move(to_report_.back());
    to_report_.pop_back();
    // One that the server does not take anything of would end the connection.
    if (!agent_.plan->IsDelivering(spooled.stream)) continue;
    const CameraReport report = ReportOf(spooled);
    const uint64_t counted = CountedIn(report);
    if (counted == 0 || std::exchange(reported_[report.stream], counted) == counted) continue;
    v1::ConnectRequest message;
    *message.mutable_report() = wire::ToProto(report);
    return message;
  }
  return std::nullopt;
}

CameraReport Conversation::ReportOf(const SpooledStream& spooled) const {
  CameraReport report;
  const CameraPipeline* const pipeline = PipelineOf(spooled.stream.camera);
  if (spooled.end) {
    report = spooled.end->report;
  } else if (pipeline != nullptr) {
    std::optional<CameraReport> running = pipeline->RunningReport();
    if (running && running->stream == spooled.stream) report = *std::move(running);
  }
  report.stream = spooled.stream;
  report.spool = SpoolReportOf(spooled);
  return report;
}

CameraPipeline* Conversation::PipelineOf(const std::string& camera) const {
  const auto found = agent_.cameras->find(camera);
  return found == agent_.cameras->end() ? nullptr : found->second.get();
}

absl::Status Conversation::CheckTimeouts(Clock::time_point now) const {
  if (!greeted_ && now - start_ >= options_.hello_timeout) {
    return absl::DeadlineExceededError(
        absl::StrCat("no answer within ", options_.hello_timeout.count(), " ms"));
  }
  if (now - last_heard_ >= options_.silence_timeout) {
    return absl::DeadlineExceededError(
        absl::StrCat("the server has been silent for ", options_.silence_timeout.count(), " ms"));
  }
  return absl::OkStatus();
}

Conversation::Clock::time_point Conversation::NextDeadline(Clock::time_point now,
                                                           bool can_send) const {
  if (!greeted_) return start_ + options_.hello_timeout;
  const Clock::time_point silent = last_heard_ + options_.silence_timeout;
  // While a write is on its way nothing else can leave; its end wakes this thread.
  if (!can_send) return silent;
  if (agent_.plan->HasOpenStreams()) {
    return std::min(now + options_.flush_interval, agent_.plan->next_due());
  }
  return std::min(silent, next_ping_);
}

}  // namespace rigcal::agent

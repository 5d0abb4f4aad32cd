// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/agent_stream.h"

#include <spdlog/spdlog.h>

#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/log/log_fields.h"
#include "common/status/guarded.h"
#include "common/wire/agent_wire.h"
#include "common/wire/detector_wire.h"
#include "common/wire/grpc_status.h"
#include "common/wire/offer_wire.h"
#include "common/wire/preview_wire.h"
#include "common/wire/protocol_version.h"
#include "common/wire/request_traits.h"
#include "common/wire/spool_wire.h"
#include "server/identity/generation_proof.h"
#include "server/rpc/agent_stream_link.h"
#include "server/session/utc_clock.h"

namespace rigcal::server {
namespace {

constexpr size_t kMaxKeptBytes = 256u << 10;

// Agents renew their certificates long before.
void WarnOfEnd(const Peer& peer) {
  constexpr int64_t kDayNs = int64_t{86'400} * 1'000'000'000;
  if (!peer.has_certificate) return;
  const int64_t left_days = (peer.not_after_utc_s * 1'000'000'000 - UtcNowNs({})) / kDayNs;
  if (left_days >= 7) return;
  spdlog::warn("the certificate of {} ends in {} days, and the agent has not renewed it",
               Describe(peer), left_days);
}

}  // namespace

void AgentStreamEnvironment::AuditRefusal(const Caller& caller, const std::string& agent_id,
                                          const absl::Status& reason) {
  if (!absl::IsPermissionDenied(reason) && !absl::IsAlreadyExists(reason)) return;
  security->audit().Write("refused", Describe(caller.peer),
                          {{"address", caller.address},
                           {"agent_id", agent_id},
                           {"reason", std::string(reason.message())}});
}

grpc::ServerBidiReactor<v1::ConnectRequest, v1::ConnectResponse>* AgentStream::Open(
    AgentStreamEnvironment* environment, Caller caller, std::string correlation) {
  std::shared_ptr<AgentStream> stream(
      new AgentStream(environment, std::move(caller), std::move(correlation)));
  AgentStream* reactor = stream.get();
  reactor->self_ = std::move(stream);
  reactor->Begin();
  return reactor;
}

void AgentStream::Begin() {
  const auto deadline = std::chrono::system_clock::now() + environment_.options.hello_timeout;
  hello_alarm_.Set(deadline, [weak = weak_from_this()](bool expired) {
    if (!expired) return;
    const auto stream = weak.lock();
    if (!stream) return;
    std::lock_guard lock(stream->mutex_);
    if (!stream->hello_seen_) {
      stream->EndWith(absl::DeadlineExceededError("no hello came in time; the stream is closed"));
    }
  });
  ticket_ = environment_.without_hello.Add([weak = weak_from_this()] {
    const auto stream = weak.lock();
    if (!stream) return;
    stream->Close(absl::ResourceExhaustedError(
        "too many streams are open that have not sent their hello; the oldest is closed"));
  });
  StartRead(&request_);
}

void AgentStream::OnReadDone(bool ok) {
  bool first = false;
  {
    std::lock_guard lock(mutex_);
    if (!ok) {
      reads_ended_ = true;
      if (!hello_seen_) {
        return EndWith(absl::InvalidArgumentError(
            "hello: the stream ended without one, or with bytes that are no message"));
      }
      FinishWhenAllIsAnswered();
      return;
    }
    if (ended_) return;
    first = !std::exchange(hello_seen_, true);
  }
  environment_.security->NoteMessage(caller_, request_.ByteSizeLong());
  if (const absl::Status fault = wire::FaultOf(request_); !fault.ok()) return Refuse(fault);
  if (first) {
    hello_alarm_.Cancel();
    environment_.without_hello.Remove(ticket_);
    TakeHello();
  } else {
    TakeMessage();
  }
}

void AgentStream::TakeHello() {
  counted_ = true;
  if (++environment_.open_streams > environment_.options.max_streams) {
    return Close(absl::ResourceExhaustedError(
        absl::StrCat(environment_.options.max_streams, " agent streams are open, which is the ",
                     "limit; try again later, or raise limits.max_agents on the server")));
  }
  if (!request_.has_hello()) {
    return Close(absl::InvalidArgumentError("hello: must be the first message of the stream"));
  }
  absl::StatusOr<AgentHello> hello = wire::FromProto(request_.hello());
  if (!hello.ok()) return Refuse(hello.status());
  agent_id_ = hello->agent.agent_id;
  hello->agent.address = caller_.address.substr(0, caller_.address.rfind(':'));
  if (const absl::Status status = CheckName(&*hello); !status.ok()) return Refuse(status);
  if (const absl::Status status = CheckGeneration(*hello); !status.ok()) return Refuse(status);
  keeps_until_standby_ = hello->keeps_until_standby && environment_.standbys != nullptr;
  rig_ = hello->agent.rig;
  for (const AnnouncedCamera& camera : hello->agent.cameras) {
    cameras_.insert(camera.description.camera);
  }
  for (const StreamKey& stream : hello->pending) cameras_.insert(stream.camera);
  // Reads the store, so not here.
  environment_.tasks.Post([self = shared_from_this(), hello = *std::move(hello)]() mutable {
    self->Register(std::move(hello));
  });
}

absl::Status AgentStream::CheckName(AgentHello* hello) const {
  if (!caller_.peer.has_certificate) {
    hello->agent.credential = CredentialOf(hello->secret);
    return absl::OkStatus();
  }
  hello->agent.credential =
      absl::StrCat(std::string(kCertificateCredential), CredentialOf(hello->secret));
  if (caller_.peer.IsAgent() && caller_.peer.name == hello->agent.agent_id) {
    return absl::OkStatus();
  }
  return absl::PermissionDeniedError(
      absl::StrCat(Describe(caller_.peer), " must not connect as agent '", hello->agent.agent_id,
                   "': the certificate names who it is; join again to change the name"));
}

absl::Status AgentStream::CheckGeneration(const AgentHello& hello) const {
  if (environment_.standbys == nullptr || hello.known_server_id != environment_.server_id ||
      hello.known_generation <= environment_.generation.number) {
    return absl::OkStatus();
  }
  const absl::Status proven =
      CheckGenerationProof(environment_.generation.identity_folder, environment_.server_id,
                           hello.known_generation, hello.known_generation_proof);
  if (!proven.ok()) {
    spdlog::warn(
        "agent '{}' says that a standby with generation {} has taken over from this server, and "
        "cannot prove it ({}): this server goes on. If one has, tell this server: stop it, and "
        "start it with --follow",
        hello.agent.agent_id, hello.known_generation, std::string(proven.message()));
    return absl::FailedPreconditionError(absl::StrCat(
        "agent '", hello.agent.agent_id, "' knows generation ", hello.known_generation,
        " of this server, which has generation ", environment_.generation.number,
        ", and cannot prove it: remove server.generation from the agent's state folder if no ",
        "standby has taken over"));
  }
  environment_.standbys->Supersede(hello.known_generation,
                                   absl::StrCat("agent ", hello.agent.agent_id, " says so"));
  return absl::FailedPreconditionError(
      absl::StrCat("this server has generation ", environment_.generation.number, ", and agent '",
                   hello.agent.agent_id, "' has spoken with generation ", hello.known_generation,
                   ": a standby has taken over, and this server stops"));
}

void AgentStream::Register(AgentHello hello) {
  const LogScope scope({.correlation = correlation_});
  {
    // After a takeover many agents wait here, and one that has given up is asking again.
    const std::lock_guard lock(mutex_);
    if (done_) return;
  }
  const size_t camera_count = hello.agent.cameras.size();
  const std::string host = hello.agent.host;
  AgentRegistry* const registry = environment_.registry;
  const AgentRecord agent = registry == nullptr ? AgentRecord() : hello.agent;
  uint64_t listener = 0;
  if (keeps_until_standby_) {
    listener = environment_.standbys->AddListener(
        [weak = weak_from_this()](const std::vector<StreamProgress>& streams) {
          if (const auto stream = weak.lock()) stream->TellStandby(streams);
        });
    const std::lock_guard lock(mutex_);
    standby_listener_ = listener;
    kept_streams_.insert(hello.pending.begin(), hello.pending.end());
  }
  if (registry != nullptr) {
    if (const absl::Status status = registry->Check(agent); !status.ok()) return Refuse(status);
  }
  auto connection = environment_.coordinator->ConnectAgent(std::move(hello.agent), hello.pending,
                                                           LinkTo(weak_from_this()));
  if (!connection.ok()) return Refuse(connection.status());
  if (registry != nullptr) {
    if (const absl::Status status = registry->Remember(agent); !status.ok()) {
      environment_.coordinator->DisconnectAgent(connection->registration);
      return Refuse(status);
    }
  }
  environment_.security->audit().Write("agent_connected", Describe(caller_.peer),
                                       {{"address", caller_.address},
                                        {"agent_id", agent_id_},
                                        {"host", host},
                                        {"rig", rig_},
                                        {"cameras", absl::StrJoin(cameras_, ",")}});
  WarnOfEnd(caller_.peer);
  v1::ServerHello answer;
  *answer.mutable_protocol_version() = wire::OwnProtocolVersion();
  answer.set_takes_offers(true);
  answer.set_software_version(std::string(wire::kSoftwareVersion));
  answer.set_server_id(environment_.server_id);
  answer.set_generation(environment_.generation.number);
  answer.set_generation_proof(environment_.generation.proof);
  answer.set_max_message_bytes(environment_.options.max_message_bytes);
  answer.set_max_batch_observations(environment_.options.max_batch_rows);
  if (environment_.options.servers) {
    for (const std::string& server : environment_.options.servers()) answer.add_servers(server);
  }
  for (const StreamPosition& position : connection->positions) {
    *answer.add_positions() = wire::ToProto(position);
  }
  {
    std::lock_guard lock(mutex_);
    if (!done_) {
      registration_ = connection->registration;
      outgoing_.SetHello(std::move(answer));
      for (const StreamKey& stream : kept_streams_) {
        AddStandbyAcks({environment_.standbys->Of(stream)});
      }
      Pump();
      ReadNext();
      spdlog::info("agent {} on {} connected with {} cameras of rig {}", agent_id_, host,
                   camera_count, rig_);
      return;
    }
  }
  if (listener != 0) environment_.standbys->RemoveListener(listener);
  // It went while it was being registered, and OnDone knew of no registration.
  environment_.coordinator->DisconnectAgent(connection->registration);
}

void AgentStream::TakeMessage() {
  switch (request_.message_case()) {
    case v1::ConnectRequest::kBatch:
      return Deliver(ParseDelivery(request_.batch(), environment_.options.max_batch_rows));
    case v1::ConnectRequest::kEndOfCapture:
      return Deliver(ParseDelivery(request_.end_of_capture()));
    case v1::ConnectRequest::kReport:
      return Deliver(ParseDelivery(request_.report()));
    case v1::ConnectRequest::kTimePing: {
      if (request_.time_ping().has_spool()) {
        absl::StatusOr<SpoolStatus> spool =
            wire::FromProto(request_.time_ping().spool(), "time_ping.spool");
        if (!spool.ok()) return Refuse(spool.status());
        AgentDirectory::Registration registration = 0;
        {
          std::lock_guard lock(mutex_);
          registration = registration_;
        }
        if (keeps_until_standby_ && spool->problem.empty() &&
            !environment_.standbys->IsConnected()) {
          spool->problem =
              "observations are kept until a standby has them (--durable-on standby): none is "
              "connected; start one (rigcal-server --follow), or run the agent without";
        }
        environment_.coordinator->RecordSpool(registration, *std::move(spool));
      }
      std::lock_guard lock(mutex_);
      outgoing_.AddPing(request_.time_ping().host_monotonic_ns());
      Pump();
      ReadNext();
      return;
    }
    case v1::ConnectRequest::kPreview:
      return TakePreview();
    case v1::ConnectRequest::kDetectorAnswer:
      return TakeDetectorAnswer();
    case v1::ConnectRequest::kOffer:
      return TakeOffer();
    case v1::ConnectRequest::kChoiceAnswer:
      return TakeChoiceAnswer();
    case v1::ConnectRequest::kHello:
      return Close(absl::InvalidArgumentError("hello: was sent already on this stream"));
    case v1::ConnectRequest::MESSAGE_NOT_SET:
      return Close(absl::InvalidArgumentError("message: is not set, or unknown to this server"));
  }
}

void AgentStream::TakePreview() {
  absl::StatusOr<Preview> preview = wire::FromProto(std::move(*request_.mutable_preview()));
  if (!preview.ok()) return Refuse(preview.status());
  AgentDirectory::Registration registration = 0;
  {
    std::lock_guard lock(mutex_);
    registration = registration_;
    ReadNext();
  }
  environment_.previews->TakeAnswer(registration, *std::move(preview));
}

void AgentStream::TakeDetectorAnswer() {
  absl::StatusOr<DetectorAnswer> answer = wire::FromProto(request_.detector_answer());
  if (!answer.ok()) return Refuse(answer.status());
  AgentDirectory::Registration registration = 0;
  {
    std::lock_guard lock(mutex_);
    registration = registration_;
    ReadNext();
  }
  environment_.detectors->TakeAnswer(registration, *std::move(answer));
}

void AgentStream::TakeOffer() {
  absl::StatusOr<std::vector<OfferedCamera>> cameras = wire::FromProto(request_.offer());
  if (!cameras.ok()) return Refuse(cameras.status());
  AgentDirectory::Registration registration = 0;
  {
    std::lock_guard lock(mutex_);
    registration = registration_;
    // One of a stream that has ended would stay for ever.
    if (registration != 0 && !done_) {
      environment_.choices->TakeOffer(registration, agent_id_, *std::move(cameras));
    }
    ReadNext();
  }
}

void AgentStream::TakeChoiceAnswer() {
  absl::StatusOr<ChoiceAnswer> answer = wire::FromProto(request_.choice_answer());
  if (!answer.ok()) return Refuse(answer.status());
  AgentDirectory::Registration registration = 0;
  {
    std::lock_guard lock(mutex_);
    registration = registration_;
    ReadNext();
  }
  environment_.choices->TakeAnswer(registration, *std::move(answer));
}

void AgentStream::Deliver(absl::StatusOr<Delivery> delivery) {
  if (!delivery.ok()) return Refuse(delivery.status());
  const StreamKey& stream = delivery->stream();
  if (!cameras_.contains(stream.camera)) {
    return Refuse(absl::PermissionDeniedError(
        absl::StrCat("agent '", agent_id_, "' must not deliver camera '", stream.camera,
                     "': it has not announced it")));
  }
  if (absl::Status status =
          environment_.coordinator->contexts().CheckAgent(stream, agent_id_, rig_);
      !status.ok()) {
    return Refuse(status);
  }
  if (delivery->report && delivery->report->spool) {
    environment_.coordinator->RecordStreamReport(stream, *delivery->report->spool);
  }
  delivery_ = *std::move(delivery);
  Submit();
}

void AgentStream::Submit() {
  {
    std::lock_guard lock(mutex_);
    if (ended_) return;
    ++unanswered_;
    if (keeps_until_standby_) kept_streams_.insert(delivery_.stream());
  }
  const absl::Status status = environment_.ingest->Submit(
      delivery_,
      [weak = weak_from_this()](absl::StatusOr<BatchAck> ack) {
        const auto stream = weak.lock();
        if (!stream) return;
        const absl::Status answered =
            Guarded("an acknowledgement", [&] { stream->Delivered(std::move(ack)); });
        // The agent would wait for it; after a new connection it learns what is durable.
        if (!answered.ok()) stream->Close(answered);
      },
      [weak = weak_from_this()] {
        // On the writer's thread: checking the values again is work for another one.
        const auto stream = weak.lock();
        if (!stream) return;
        std::lock_guard lock(stream->mutex_);
        if (stream->done_) return;
        stream->environment_.tasks.Post([weak] {
          if (const auto again = weak.lock()) again->Submit();
        });
      });
  std::lock_guard lock(mutex_);
  if (status.ok()) {
    ReadNext();
    return;
  }
  --unanswered_;
  // Full: delivery_ waits for on_space, and nothing is read until then.
  if (!absl::IsResourceExhausted(status)) EndWith(status);
}

void AgentStream::Delivered(absl::StatusOr<BatchAck> ack) {
  std::lock_guard lock(mutex_);
  --unanswered_;
  if (ended_) return;
  if (!ack.ok()) return EndWith(ack.status());
  if (!outgoing_.AddAck(*std::move(ack))) {
    return EndWith(absl::ResourceExhaustedError(
        "too many acknowledgements wait for the agent to read them; connect again"));
  }
  Pump();
  FinishWhenAllIsAnswered();
}

void AgentStream::Send(v1::ConnectResponse command) {
  std::lock_guard lock(mutex_);
  if (ended_) return;
  if (!outgoing_.AddCommand(std::move(command))) {
    return EndWith(absl::ResourceExhaustedError(
        "too many commands wait for the agent to read them; connect again"));
  }
  Pump();
}

void AgentStream::Close(const absl::Status& reason) {
  std::lock_guard lock(mutex_);
  EndWith(reason);
}

void AgentStream::Refuse(const absl::Status& reason) {
  const LogScope scope({.correlation = correlation_});
  spdlog::warn("agent '{}' is refused: {}", agent_id_, std::string(reason.message()));
  environment_.AuditRefusal(caller_, agent_id_, reason);
  Close(reason);
}

void AgentStream::ReadNext() {
  if (ended_) return;
  // A message keeps its memory for the next one, which is good up to a point.
  if (request_.SpaceUsedLong() > kMaxKeptBytes) request_ = v1::ConnectRequest();
  StartRead(&request_);
}

void AgentStream::Pump() {
  if (writing_ || ended_) return;
  response_.Clear();
  if (!outgoing_.Next(UtcNowNs({}), &response_)) return;
  writing_ = true;
  StartWrite(&response_);
}

void AgentStream::OnWriteDone(bool ok) {
  std::lock_guard lock(mutex_);
  writing_ = false;
  if (!ok) return EndWith(absl::CancelledError("the agent's connection is gone"));
  Pump();
  FinishWhenAllIsAnswered();
}

void AgentStream::FinishWhenAllIsAnswered() {
  if (reads_ended_ && unanswered_ == 0 && !writing_ && outgoing_.empty()) {
    EndWith(absl::OkStatus());
  }
}

void AgentStream::EndWith(const absl::Status& status) {
  if (std::exchange(ended_, true)) return;
  Finish(wire::ToGrpc(status));
}

void AgentStream::OnCancel() { Close(absl::CancelledError("the agent's connection is gone")); }

void AgentStream::TellStandby(const std::vector<StreamProgress>& streams) {
  const std::lock_guard lock(mutex_);
  if (ended_ || registration_ == 0) return;
  AddStandbyAcks(streams);
  Pump();
}

void AgentStream::AddStandbyAcks(const std::vector<StreamProgress>& streams) {
  for (const StreamProgress& progress : streams) {
    if (!kept_streams_.contains(progress.stream)) continue;
    // One that finds no room is repeated with the stream's next rows, or after a new connection.
    outgoing_.AddAck({.stream = progress.stream,
                      .durable_seq = 0,
                      .send_limit_seq = 0,
                      .faults = {},
                      .standby_durable_seq = progress.durable_seq,
                      .standby_complete = progress.complete});
  }
}

void AgentStream::OnDone() {
  const LogScope scope({.correlation = correlation_});
  AgentDirectory::Registration registration = 0;
  uint64_t listener = 0;
  {
    std::lock_guard lock(mutex_);
    done_ = true;
    registration = registration_;
    listener = std::exchange(standby_listener_, 0);
  }
  if (listener != 0) environment_.standbys->RemoveListener(listener);
  hello_alarm_.Cancel();
  environment_.without_hello.Remove(ticket_);
  if (registration != 0) {
    environment_.coordinator->DisconnectAgent(registration);
    environment_.previews->AgentGone(registration);
    environment_.detectors->AgentGone(registration);
    environment_.choices->AgentGone(registration);
    spdlog::info("agent {} disconnected", agent_id_);
  }
  if (counted_) --environment_.open_streams;
  environment_.security->EndCall(caller_);
  const auto last = std::move(self_);
}

}  // namespace rigcal::server

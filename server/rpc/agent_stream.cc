// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/agent_stream.h"

#include <spdlog/spdlog.h>

#include <utility>

#include "absl/strings/str_cat.h"
#include "common/wire/agent_wire.h"
#include "common/wire/grpc_status.h"
#include "common/wire/preview_wire.h"
#include "common/wire/protocol_version.h"
#include "server/session/utc_clock.h"

namespace rigcal::server {
namespace {

constexpr size_t kMaxKeptBytes = 256u << 10;

// The coordinator's way to a stream that may have ended.
class StreamLink final : public AgentLink {
 public:
  explicit StreamLink(std::weak_ptr<AgentStream> stream) : stream_(std::move(stream)) {}

  void SendStartCapture(const StartCaptureCommand& command) override {
    v1::ConnectResponse message;
    *message.mutable_start_capture() = wire::ToProto(command);
    if (const auto stream = stream_.lock()) stream->Send(std::move(message));
  }
  void SendStopCapture(const std::string& session_id) override {
    v1::ConnectResponse message;
    message.mutable_stop_capture()->set_session_id(session_id);
    if (const auto stream = stream_.lock()) stream->Send(std::move(message));
  }
  void SendPreviewRequest(const PreviewRequest& request) override {
    v1::ConnectResponse message;
    *message.mutable_preview_request() = wire::ToProto(request);
    if (const auto stream = stream_.lock()) stream->Send(std::move(message));
  }
  void Close(const absl::Status& reason) override {
    if (const auto stream = stream_.lock()) stream->Close(reason);
  }

 private:
  const std::weak_ptr<AgentStream> stream_;
};

}  // namespace

grpc::ServerBidiReactor<v1::ConnectRequest, v1::ConnectResponse>* AgentStream::Open(
    AgentStreamEnvironment* environment) {
  std::shared_ptr<AgentStream> stream(new AgentStream(environment));
  AgentStream* reactor = stream.get();
  reactor->self_ = std::move(stream);
  ++environment->open_streams;
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
  if (first) {
    hello_alarm_.Cancel();
    TakeHello();
  } else {
    TakeMessage();
  }
}

void AgentStream::TakeHello() {
  if (!request_.has_hello()) {
    return Close(absl::InvalidArgumentError("hello: must be the first message of the stream"));
  }
  absl::StatusOr<AgentHello> hello = wire::FromProto(request_.hello());
  if (!hello.ok()) return Refuse(hello.status());
  agent_id_ = hello->agent.agent_id;
  rig_ = hello->agent.rig;
  for (const AnnouncedCamera& camera : hello->agent.cameras) {
    cameras_.insert(camera.description.camera);
  }
  // Reads the store, so not here.
  environment_.tasks.Post([self = shared_from_this(), hello = *std::move(hello)]() mutable {
    self->Register(std::move(hello));
  });
}

void AgentStream::Register(AgentHello hello) {
  const size_t camera_count = hello.agent.cameras.size();
  const std::string host = hello.agent.host;
  auto connection = environment_.coordinator->ConnectAgent(
      std::move(hello.agent), hello.pending, std::make_shared<StreamLink>(weak_from_this()));
  if (!connection.ok()) return Refuse(connection.status());
  v1::ServerHello answer;
  *answer.mutable_protocol_version() = wire::OwnProtocolVersion();
  answer.set_software_version(std::string(wire::kSoftwareVersion));
  answer.set_server_id(environment_.server_id);
  answer.set_max_message_bytes(environment_.options.max_message_bytes);
  answer.set_max_batch_observations(environment_.options.max_batch_rows);
  for (const StreamPosition& position : connection->positions) {
    *answer.add_positions() = wire::ToProto(position);
  }
  {
    std::lock_guard lock(mutex_);
    if (!done_) {
      registration_ = connection->registration;
      outgoing_.SetHello(std::move(answer));
      Pump();
      ReadNext();
      spdlog::info("agent {} on {} connected with {} cameras of rig {}", agent_id_, host,
                   camera_count, rig_);
      return;
    }
  }
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
      std::lock_guard lock(mutex_);
      outgoing_.AddPing(request_.time_ping().host_monotonic_ns());
      Pump();
      ReadNext();
      return;
    }
    case v1::ConnectRequest::kPreview:
      return TakePreview();
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

void AgentStream::Deliver(absl::StatusOr<Delivery> delivery) {
  if (!delivery.ok()) return Refuse(delivery.status());
  const StreamKey& stream = delivery->stream();
  if (!cameras_.contains(stream.camera)) {
    return Close(absl::PermissionDeniedError(
        absl::StrCat("agent '", agent_id_, "' must not deliver camera '", stream.camera,
                     "': it has not announced it")));
  }
  if (absl::Status status =
          environment_.coordinator->contexts().CheckAgent(stream, agent_id_, rig_);
      !status.ok()) {
    return Close(status);
  }
  delivery_ = *std::move(delivery);
  Submit();
}

void AgentStream::Submit() {
  {
    std::lock_guard lock(mutex_);
    if (ended_) return;
    ++unanswered_;
  }
  const absl::Status status = environment_.ingest->Submit(
      delivery_,
      [weak = weak_from_this()](absl::StatusOr<BatchAck> ack) {
        if (const auto stream = weak.lock()) stream->Delivered(std::move(ack));
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
  spdlog::warn("agent '{}' is refused: {}", agent_id_, std::string(reason.message()));
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

void AgentStream::OnDone() {
  AgentDirectory::Registration registration = 0;
  {
    std::lock_guard lock(mutex_);
    done_ = true;
    registration = registration_;
  }
  hello_alarm_.Cancel();
  if (registration != 0) {
    environment_.coordinator->DisconnectAgent(registration);
    environment_.previews->AgentGone(registration);
    spdlog::info("agent {} disconnected", agent_id_);
  }
  --environment_.open_streams;
  const auto last = std::move(self_);
}

}  // namespace rigcal::server

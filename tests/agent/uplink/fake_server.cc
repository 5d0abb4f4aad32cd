// SPDX-License-Identifier: Apache-2.0
#include "tests/agent/uplink/fake_server.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "common/wire/camera_wire.h"
#include "common/wire/observation_wire.h"
#include "common/wire/protocol_version.h"
#include "tests/agent/uplink/scripted_source.h"

namespace rigcal::agent {

// One stream; all of its state is guarded by the server's mutex.
class FakeServer::Connection
    : public grpc::ServerBidiReactor<v1::ConnectRequest, v1::ConnectResponse> {
 public:
  explicit Connection(FakeServer* server) : server_(server) { StartRead(&incoming_); }

  void SendLocked(v1::ConnectResponse message) {
    if (finished_) return;
    outgoing_.push_back(std::move(message));
    if (outgoing_.size() == 1) StartWrite(&outgoing_.front());
  }
  void FinishLocked(const grpc::Status& status) {
    if (std::exchange(finished_, true)) return;
    Finish(status);
  }

 private:
  void OnReadDone(bool ok) override {
    const std::lock_guard lock(server_->mutex_);
    if (!ok) return FinishLocked(grpc::Status::OK);
    if (finished_) return;
    std::vector<v1::ConnectResponse> answers;
    const std::optional<grpc::Status> refusal = server_->Take(incoming_, &answers);
    for (v1::ConnectResponse& answer : answers) SendLocked(std::move(answer));
    if (refusal) {
      FinishLocked(*refusal);
    } else {
      StartRead(&incoming_);
    }
    server_->changed_.notify_all();
  }
  void OnWriteDone(bool) override {
    const std::lock_guard lock(server_->mutex_);
    outgoing_.pop_front();
    if (!finished_ && !outgoing_.empty()) StartWrite(&outgoing_.front());
  }
  void OnCancel() override {
    const std::lock_guard lock(server_->mutex_);
    FinishLocked(grpc::Status::CANCELLED);
  }
  void OnDone() override {
    const std::lock_guard lock(server_->mutex_);
    if (server_->newest_ == this) server_->newest_ = nullptr;
    delete this;
  }

  FakeServer* const server_;
  v1::ConnectRequest incoming_;
  std::deque<v1::ConnectResponse> outgoing_;
  bool finished_ = false;
};

const FakeServer::Stream& FakeServer::State::At(const StreamKey& key) const {
  static const auto* const none = new Stream;
  const auto found = streams.find(key);
  return found == streams.end() ? *none : found->second;
}

bool FakeServer::State::HasEnded(const StreamKey& key) const {
  const Stream& stream = At(key);
  return stream.end && stream.durable_seq >= stream.end->last_seq;
}

FakeServer::FakeServer() { Listen(); }

FakeServer::FakeServer(int port) : port_(port) { Listen(); }

FakeServer::~FakeServer() { Close(); }

void FakeServer::Listen() {
  grpc::ServerBuilder builder;
  builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
  builder.AddListeningPort("127.0.0.1:" + std::to_string(port_), grpc::InsecureServerCredentials(),
                           &port_);
  builder.RegisterService(this);
  server_ = builder.BuildAndStart();
  ASSERT_NE(server_, nullptr);
}

void FakeServer::Close() {
  Disconnect(grpc::Status(grpc::StatusCode::UNAVAILABLE, "the server shuts down"));
  if (server_ == nullptr) return;
  server_->Shutdown(std::chrono::system_clock::now() + std::chrono::seconds(5));
  server_->Wait();
  server_.reset();
}

// Over loopback. With gRPC's in-process channel tests sometimes hung at their end on a busy
// machine, after the agent had closed its stream.
std::shared_ptr<grpc::Channel> FakeServer::Channel() {
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  return grpc::CreateCustomChannel("127.0.0.1:" + std::to_string(port_),
                                   grpc::InsecureChannelCredentials(), arguments);
}

grpc::ServerBidiReactor<v1::ConnectRequest, v1::ConnectResponse>* FakeServer::Connect(
    grpc::CallbackServerContext*) {
  const std::lock_guard lock(mutex_);
  return newest_ = new Connection(this);
}

void FakeServer::Set(const std::function<void(FakeBehaviour&)>& change) {
  const std::lock_guard lock(mutex_);
  change(behaviour_);
}

FakeServer::State FakeServer::Now() const {
  const std::lock_guard lock(mutex_);
  return state_;
}

FakeServer::State FakeServer::WaitFor(const std::function<bool(const State&)>& condition) {
  std::unique_lock lock(mutex_);
  const bool holds =
      changed_.wait_for(lock, std::chrono::minutes(1), [&] { return condition(state_); });
  EXPECT_TRUE(holds) << "the awaited condition did not become true";
  return state_;
}

v1::AgentHello FakeServer::WaitForHello(size_t number) {
  const State state = WaitFor([&](const State& now) { return now.hellos.size() >= number; });
  return state.hellos.size() < number ? v1::AgentHello() : state.hellos[number - 1];
}

void FakeServer::Send(v1::ConnectResponse message) {
  const std::lock_guard lock(mutex_);
  if (newest_ != nullptr) newest_->SendLocked(std::move(message));
}

void FakeServer::StartCapture(const std::string& session_id,
                              const std::vector<std::string>& cameras, uint32_t stream_epoch) {
  v1::ConnectResponse message;
  v1::StartCapture* command = message.mutable_start_capture();
  command->set_session_id(session_id);
  *command->mutable_target() = wire::ToProto(MakeTarget());
  {
    const std::lock_guard lock(mutex_);
    for (const std::string& camera : cameras) {
      *command->add_cameras() = PositionOf({session_id, camera, stream_epoch});
    }
  }
  Send(std::move(message));
}

void FakeServer::StopCapture(const std::string& session_id) {
  v1::ConnectResponse message;
  message.mutable_stop_capture()->set_session_id(session_id);
  Send(std::move(message));
}

void FakeServer::Disconnect(const grpc::Status& status) {
  const std::lock_guard lock(mutex_);
  if (newest_ != nullptr) newest_->FinishLocked(status);
  newest_ = nullptr;
}

void FakeServer::AcknowledgeAll() {
  const std::lock_guard lock(mutex_);
  behaviour_.acknowledges = true;
  for (auto& [key, stream] : state_.streams) {
    const v1::ConnectResponse ack = AckOf(key);
    if (newest_ != nullptr) newest_->SendLocked(ack);
  }
  changed_.notify_all();
}

std::optional<grpc::Status> FakeServer::Take(const v1::ConnectRequest& message,
                                             std::vector<v1::ConnectResponse>* answers) {
  if (message.has_hello()) {
    state_.hellos.push_back(message.hello());
  } else {
    ++state_.message_count;
  }
  if (behaviour_.refuses) {
    if (auto status = behaviour_.refuses(message)) return status;
  }
  switch (message.message_case()) {
    case v1::ConnectRequest::kHello:
      if (behaviour_.answers_hello) answers->push_back(HelloFor(message.hello()));
      break;
    case v1::ConnectRequest::kBatch: {
      const auto batch = wire::FromProto(message.batch());
      if (!batch.ok()) {
        return grpc::Status(grpc::StatusCode::INVALID_ARGUMENT, batch.status().ToString());
      }
      Store(*batch);
      if (behaviour_.acknowledges) {
        answers->push_back(AckOf(batch->stream));
      }
      break;
    }
    case v1::ConnectRequest::kEndOfCapture: {
      const auto end = wire::FromProto(message.end_of_capture());
      if (!end.ok()) {
        return grpc::Status(grpc::StatusCode::INVALID_ARGUMENT, end.status().ToString());
      }
      state_.streams[end->stream].end = *end;
      if (behaviour_.acknowledges) answers->push_back(AckOf(end->stream));
      break;
    }
    case v1::ConnectRequest::kReport: {
      const auto report = wire::FromProto(message.report());
      if (report.ok()) state_.streams[report->stream].report = *report;
      break;
    }
    case v1::ConnectRequest::kTimePing:
      ++state_.ping_count;
      if (behaviour_.answers_pings) {
        v1::TimePong* pong = answers->emplace_back().mutable_time_pong();
        pong->set_host_monotonic_ns(message.time_ping().host_monotonic_ns());
        pong->set_server_utc_ns(
            std::chrono::nanoseconds(std::chrono::system_clock::now().time_since_epoch()).count());
      }
      break;
    case v1::ConnectRequest::kChoiceAnswer:
    case v1::ConnectRequest::kDetectorAnswer:
    case v1::ConnectRequest::kOffer:
    case v1::ConnectRequest::kPreview:
    case v1::ConnectRequest::MESSAGE_NOT_SET:
      break;
  }
  return std::nullopt;
}

void FakeServer::Store(const ObservationBatch& batch) {
  Stream& stream = state_.streams[batch.stream];
  stream.batches.push_back(batch);
  stream.largest_batch = std::max(stream.largest_batch, static_cast<uint32_t>(batch.rows()));
  for (size_t row = 0; row < batch.rows(); ++row) {
    const uint32_t seq = batch.first_seq + static_cast<uint32_t>(row);
    ++stream.times_received[seq];
    stream.time_of_seq.try_emplace(seq, batch.time_ns[row]);
    stream.exceeded_credit = stream.exceeded_credit || seq > stream.send_limit_seq;
  }
}

v1::ConnectResponse FakeServer::HelloFor(const v1::AgentHello& hello) {
  v1::ConnectResponse message;
  v1::ServerHello* answer = message.mutable_hello();
  *answer->mutable_protocol_version() = wire::OwnProtocolVersion();
  answer->mutable_protocol_version()->set_major(behaviour_.protocol_major);
  answer->set_server_id(behaviour_.server_id);
  answer->set_max_message_bytes(4 << 20);
  answer->set_max_batch_observations(behaviour_.max_batch_observations);
  for (const v1::StreamKey& pending : hello.pending()) {
    const auto key = wire::FromProto(pending);
    EXPECT_TRUE(key.ok()) << key.status();
    *answer->add_positions() = PositionOf(key.ok() ? *key : StreamKey{});
  }
  return message;
}

v1::StreamPosition FakeServer::PositionOf(const StreamKey& key) {
  v1::StreamPosition position;
  *position.mutable_stream() = wire::ToProto(key);
  if (behaviour_.unknown_sessions.contains(key.session_id)) {
    position.set_unknown(true);
    return position;
  }
  Stream& stream = state_.streams[key];
  stream.send_limit_seq = std::max(stream.send_limit_seq, stream.durable_seq + behaviour_.window);
  position.set_durable_seq(stream.durable_seq);
  position.set_send_limit_seq(stream.send_limit_seq);
  return position;
}

v1::ConnectResponse FakeServer::AckOf(const StreamKey& key) {
  Stream& stream = state_.streams[key];
  while (stream.time_of_seq.contains(stream.durable_seq + 1)) ++stream.durable_seq;
  stream.send_limit_seq = std::max(stream.send_limit_seq, stream.durable_seq + behaviour_.window);
  BatchAck ack;
  ack.stream = key;
  ack.durable_seq = stream.durable_seq;
  ack.send_limit_seq = stream.send_limit_seq;
  ack.complete = stream.end && stream.durable_seq >= stream.end->last_seq;
  v1::ConnectResponse message;
  *message.mutable_ack() = wire::ToProto(ack);
  return message;
}

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
#include "tests/server/rpc/test_agent.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>

#include "common/wire/camera_wire.h"
#include "common/wire/grpc_status.h"
#include "common/wire/observation_wire.h"
#include "common/wire/protocol_version.h"
#include "tests/server/session/session_fixture.h"

namespace rigcal::testing {

v1::AgentHello MakeHello(const std::string& agent_id, const std::vector<std::string>& cameras,
                         uint32_t incarnation, uint32_t connection) {
  v1::AgentHello hello;
  *hello.mutable_protocol_version() = wire::OwnProtocolVersion();
  hello.set_software_version("test");
  hello.set_agent_id(agent_id);
  hello.set_incarnation(incarnation);
  hello.set_connection(connection);
  hello.set_host("host-of-" + agent_id);
  hello.set_rig("rig");
  for (const std::string& camera : cameras) {
    v1::AnnouncedCamera* announced = hello.add_cameras();
    *announced->mutable_description() = wire::ToProto(MakeCamera(camera));
    announced->set_stream_epoch(1);
  }
  return hello;
}

v1::ConnectRequest BatchMessage(const ObservationBatch& batch) {
  v1::ConnectRequest message;
  wire::ToProto(batch, message.mutable_batch());
  return message;
}

v1::ConnectRequest EndMessage(const StreamKey& stream, uint32_t last_seq) {
  v1::ConnectRequest message;
  EndOfCapture end;
  end.stream = stream;
  end.last_seq = last_seq;
  end.report = {.stream = stream, .observation_count = last_seq, .refused = {}};
  *message.mutable_end_of_capture() = wire::ToProto(end);
  return message;
}

TestAgent::TestAgent(const std::shared_ptr<grpc::Channel>& channel)
    : stub_(v1::IngestService::NewStub(channel)) {
  context_.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
  stream_ = stub_->Connect(&context_);
}

TestAgent::TestAgent(const std::shared_ptr<grpc::Channel>& channel, const v1::AgentHello& hello)
    : TestAgent(channel) {
  v1::ConnectRequest message;
  *message.mutable_hello() = hello;
  Send(message);
}

TestAgent::~TestAgent() {
  if (finished_) return;
  context_.TryCancel();
  AwaitEnd().IgnoreError();
}

void TestAgent::Send(const v1::ConnectRequest& message) { stream_->Write(message); }

std::optional<v1::ConnectResponse> TestAgent::Read() {
  v1::ConnectResponse message;
  if (!stream_->Read(&message)) return std::nullopt;
  return message;
}

v1::ConnectResponse TestAgent::ReadUntil(v1::ConnectResponse::MessageCase kind) {
  while (auto message = Read()) {
    if (message->message_case() == kind) return *message;
  }
  ADD_FAILURE() << "the stream ended: " << AwaitEnd().ToString();
  return {};
}

v1::BatchAck TestAgent::ReadAck(const std::string& camera, uint32_t durable_seq) {
  v1::BatchAck merged;
  while (auto message = Read()) {
    const v1::BatchAck& ack = message->ack();
    if (!message->has_ack() || ack.camera() != camera) continue;
    EXPECT_GE(ack.durable_seq(), merged.durable_seq()) << "it never sinks";
    merged.set_session_id(ack.session_id());
    merged.set_camera(camera);
    merged.set_stream_epoch(ack.stream_epoch());
    merged.set_durable_seq(ack.durable_seq());
    merged.set_send_limit_seq(ack.send_limit_seq());
    merged.set_fault_count(merged.fault_count() + ack.fault_count());
    merged.mutable_faults()->MergeFrom(ack.faults());
    merged.set_complete(ack.complete());
    if (ack.durable_seq() >= durable_seq) return merged;
  }
  ADD_FAILURE() << "the stream ended: " << AwaitEnd().ToString();
  return merged;
}

absl::Status TestAgent::Finish() {
  stream_->WritesDone();
  return AwaitEnd();
}

absl::Status TestAgent::AwaitEnd() {
  while (!finished_ && Read()) {
  }
  if (finished_) return absl::FailedPreconditionError("the test has ended this stream before");
  finished_ = true;
  return wire::FromGrpc(stream_->Finish());
}

}  // namespace rigcal::testing

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>
#include <grpcpp/support/sync_stream.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "common/session/observation_batch.h"
#include "common/session/stream_key.h"
#include "rigcal/v1/ingest_service.grpc.pb.h"

namespace rigcal::testing {

// The hello of an agent of rig "rig" with these cameras, each of 1280x1024 pixels in stream
// epoch 1.
v1::AgentHello MakeHello(const std::string& agent_id, const std::vector<std::string>& cameras,
                         uint32_t incarnation = 1, uint32_t connection = 1);
v1::ConnectRequest BatchMessage(const ObservationBatch& batch);
v1::ConnectRequest EndMessage(const StreamKey& stream, uint32_t last_seq);

// An agent's stream as a test drives it: raw messages, malformed ones too. Every wait ends after a
// minute at the latest.
class TestAgent {
 public:
  explicit TestAgent(const std::shared_ptr<grpc::Channel>& channel);
  // Says hello.
  TestAgent(const std::shared_ptr<grpc::Channel>& channel, const v1::AgentHello& hello);
  ~TestAgent();

  void Send(const v1::ConnectRequest& message);
  void SendBatch(const ObservationBatch& batch) { Send(BatchMessage(batch)); }
  // None: the stream has ended.
  std::optional<v1::ConnectResponse> Read();
  // Reads up to the next message of this kind; fails the test when the stream ends before.
  v1::ConnectResponse ReadUntil(v1::ConnectResponse::MessageCase kind);
  v1::ServerHello ReadHello() { return ReadUntil(v1::ConnectResponse::kHello).hello(); }
  v1::StartCapture ReadStart() {
    return ReadUntil(v1::ConnectResponse::kStartCapture).start_capture();
  }
  // Reads acknowledgements up to the one that says `durable_seq` of this camera, and merges their
  // faults into it.
  v1::BatchAck ReadAck(const std::string& camera, uint32_t durable_seq);
  // Ends the agent's side, reads what is left, returns the status.
  absl::Status Finish();
  // Reads to the end without ending the agent's side.
  absl::Status AwaitEnd();
  void Cancel() { context_.TryCancel(); }

 private:
  grpc::ClientContext context_;
  std::unique_ptr<v1::IngestService::Stub> stub_;
  std::unique_ptr<grpc::ClientReaderWriter<v1::ConnectRequest, v1::ConnectResponse>> stream_;
  bool finished_ = false;
};

}  // namespace rigcal::testing

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/grpcpp.h>

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "common/session/observation_batch.h"
#include "common/session/stream_key.h"
#include "common/wire/protocol_version.h"
#include "rigcal/v1/ingest_service.grpc.pb.h"

namespace rigcal::agent {

// Faults and delays of the fake server. Set before or during a run, through FakeServer::Set.
struct FakeBehaviour {
  std::string server_id = "store-1";
  uint32_t protocol_major = wire::kProtocolMajor;
  uint32_t window = 100'000;  // credit beyond what is durable
  uint32_t max_batch_observations = 0;
  bool answers_hello = true;
  bool answers_pings = true;
  bool acknowledges = true;  // false: nothing becomes durable
  std::set<std::string> unknown_sessions;
  // Ends the stream with this status instead of answering the message; empty: nothing does.
  std::function<std::optional<grpc::Status>(const v1::ConnectRequest&)> refuses;
};

// An AgentService that stores deliveries in memory and fails on demand.
class FakeServer : public v1::IngestService::CallbackService {
 public:
  // Deliveries of one stream.
  struct Stream {
    std::map<uint32_t, int64_t> time_of_seq;      // stored rows
    std::map<uint32_t, uint32_t> times_received;  // of each row, over all connections
    uint32_t durable_seq = 0;
    uint32_t send_limit_seq = 0;
    std::vector<ObservationBatch> batches;  // in the order of arrival
    std::optional<EndOfCapture> end;
    std::optional<CameraReport> report;
    bool exceeded_credit = false;
    uint32_t largest_batch = 0;
  };
  struct State {
    std::vector<v1::AgentHello> hellos;  // of every connection
    std::map<StreamKey, Stream> streams;
    uint32_t ping_count = 0;
    uint32_t message_count = 0;  // after the hellos

    const Stream& At(const StreamKey& key) const;
    bool HasEnded(const StreamKey& key) const;  // with everything before the end
  };

  // Inside of this process, or on 127.0.0.1 at `port` (0: a free one).
  FakeServer();
  explicit FakeServer(int port);
  ~FakeServer() override;

  std::shared_ptr<grpc::Channel> Channel();
  int port() const { return port_; }
  // Closes everything; what was stored stays. Listen opens again at the same port.
  void Close();
  void Listen();

  void Set(const std::function<void(FakeBehaviour&)>& change);
  // Until `condition` holds; fails the test after a minute. Returns the state it held for.
  State WaitFor(const std::function<bool(const State&)>& condition);
  v1::AgentHello WaitForHello(size_t number);  // from 1
  State Now() const;

  // On the newest connection.
  void StartCapture(const std::string& session_id, const std::vector<std::string>& cameras,
                    uint32_t stream_epoch = 7);
  void StopCapture(const std::string& session_id);
  void Send(v1::ConnectResponse message);
  void Disconnect(const grpc::Status& status);
  // Makes everything received durable and acknowledges it.
  void AcknowledgeAll();

 private:
  class Connection;
  grpc::ServerBidiReactor<v1::ConnectRequest, v1::ConnectResponse>* Connect(
      grpc::CallbackServerContext* context) override;
  // With mutex_ held; what to answer, and what to end the stream with.
  std::optional<grpc::Status> Take(const v1::ConnectRequest& message,
                                   std::vector<v1::ConnectResponse>* answers);
  v1::ConnectResponse HelloFor(const v1::AgentHello& hello);
  v1::StreamPosition PositionOf(const StreamKey& key);
  v1::ConnectResponse AckOf(const StreamKey& key);
  void Store(const ObservationBatch& batch);

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  FakeBehaviour behaviour_;
  State state_;
  Connection* newest_ = nullptr;
  int port_ = 0;  // 0: any, until it listens
  std::unique_ptr<grpc::Server> server_;
};

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/alarm.h>
#include <grpcpp/support/server_callback.h>

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/session/agent.h"
#include "rigcal/v1/ingest_service.pb.h"
#include "server/ingest/ingest.h"
#include "server/replica/standby_book.h"
#include "server/rpc/call_security.h"
#include "server/rpc/deliveries.h"
#include "server/rpc/outgoing_messages.h"
#include "server/rpc/streams_without_hello.h"
#include "server/session/agent_registry.h"
#include "server/session/camera_choices.h"
#include "server/session/detector_broker.h"
#include "server/session/preview_broker.h"
#include "server/session/session_coordinator.h"
#include "server/session/task_queue.h"

namespace rigcal::server {

struct AgentStreamOptions {
  uint32_t max_message_bytes = 4u << 20;
  uint32_t max_batch_rows = 8192;
  // Agent streams open at a time that have sent their hello, and besides those that have not yet.
  size_t max_streams = 320;
  size_t max_streams_without_hello = 64;
  // A stream whose hello does not come in this time is closed.
  std::chrono::milliseconds hello_timeout{10'000};
  // Addresses of the servers that take turns. Unset: there are no others.
  std::function<std::vector<std::string>()> servers = {};
};

// How often a standby has taken over from the server of this data, and what proves it.
struct DataGeneration {
  uint64_t number = 0;                         // 0: nobody can follow this server
  std::filesystem::path identity_folder = {};  // empty: this server has no keys
  std::string proof = {};                      // ProveGeneration
};

// What all agent streams of a server share; outlives them.
struct AgentStreamEnvironment {
  // PERMISSION_DENIED or ALREADY_EXISTS, with a line in the audit log: somebody claims what is not
  // theirs.
  void AuditRefusal(const Caller& caller, const std::string& agent_id, const absl::Status& reason);

  AgentStreamOptions options;
  SessionCoordinator* coordinator = nullptr;
  Ingest* ingest = nullptr;
  PreviewBroker* previews = nullptr;
  DetectorBroker* detectors = nullptr;
  CameraChoices* choices = nullptr;
  std::string server_id;
  CallSecurity* security = nullptr;
  AgentRegistry* registry = nullptr;  // null: agents and cameras belong to nobody
  StandbyBook* standbys = nullptr;    // null: nobody follows this server
  DataGeneration generation;
  StreamsWithoutHello without_hello{options.max_streams_without_hello};
  // For what the reaction of a stream must not wait for; two tasks per open stream at most.
  TaskQueue tasks{"agent streams"};
  std::atomic<size_t> open_streams{0};  // that have sent their hello
};

// One agent's stream: waits for its hello, registers it, then takes deliveries and writes
// acknowledgements and commands. gRPC calls the reactions, ingest and the coordinator call from
// their own threads; no call blocks.
//
// Reading stops while ingest is full: that is the back-pressure. The stream owns itself until
// OnDone; everybody else holds it weakly, so that an acknowledgement may come after its end.
class AgentStream final : public grpc::ServerBidiReactor<v1::ConnectRequest, v1::ConnectResponse>,
                          public std::enable_shared_from_this<AgentStream> {
 public:
  // Begins to read.
  static grpc::ServerBidiReactor<v1::ConnectRequest, v1::ConnectResponse>* Open(
      AgentStreamEnvironment* environment, Caller caller, std::string correlation);

  void OnReadDone(bool ok) override;
  void OnWriteDone(bool ok) override;
  void OnCancel() override;
  void OnDone() override;

  // Queues a command; nothing happens when the stream has ended.
  void Send(v1::ConnectResponse command);
  void Close(const absl::Status& reason);

 private:
  AgentStream(AgentStreamEnvironment* environment, Caller caller, std::string correlation)
      : environment_(*environment),
        caller_(std::move(caller)),
        correlation_(std::move(correlation)) {}

  void Begin();
  void TakeHello();
  // Whether the caller may be the agent that its hello names, with the proof of it.
  absl::Status CheckName(AgentHello* hello) const;
  void Register(AgentHello hello);
  void TakeMessage();
  void TakePreview();
  void TakeDetectorAnswer();
  void TakeOffer();
  void TakeChoiceAnswer();
  void Deliver(absl::StatusOr<Delivery> delivery);
  void Submit();
  void Delivered(absl::StatusOr<BatchAck> ack);
  // What the standby has of streams of this agent.
  void TellStandby(const std::vector<StreamProgress>& streams);
  // Not OK: another server has taken over, as the agent knows.
  absl::Status CheckGeneration(const AgentHello& hello) const;
  // Close, and a line in the log, and in that of audits where somebody claims what is not theirs.
  void Refuse(const absl::Status& reason);

  // With mutex_ held.
  void ReadNext();
  void Pump();
  void FinishWhenAllIsAnswered();
  void AddStandbyAcks(const std::vector<StreamProgress>& streams);
  void EndWith(const absl::Status& status);

  AgentStreamEnvironment& environment_;
  const Caller caller_;
  const std::string correlation_;      // of every line about this stream
  bool counted_ = false;               // among the open streams
  uint64_t ticket_ = 0;                // among the streams without hello
  std::shared_ptr<AgentStream> self_;  // until OnDone
  grpc::Alarm hello_alarm_;

  // Of the chain read -> deliver -> read, one step of which runs at a time.
  v1::ConnectRequest request_;
  Delivery delivery_;
  std::string agent_id_;
  std::string rig_;
  std::set<std::string> cameras_;
  bool keeps_until_standby_ = false;

  std::mutex mutex_;
  bool hello_seen_ = false;
  OutgoingMessages outgoing_;
  v1::ConnectResponse response_;  // being written
  bool writing_ = false;
  bool reads_ended_ = false;
  size_t unanswered_ = 0;  // deliveries with ingest
  bool ended_ = false;     // Finish has been called
  bool done_ = false;
  AgentDirectory::Registration registration_ = 0;
  std::set<StreamKey> kept_streams_;  // that the agent keeps until the standby has them
  uint64_t standby_listener_ = 0;
};

}  // namespace rigcal::server

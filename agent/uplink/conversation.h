// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "agent/capture/learning/detector_learner.h"
#include "agent/capture/preview/preview_worker.h"
#include "agent/offer/camera_offers.h"
#include "agent/spool/delivery_plan.h"
#include "agent/stamp/camera_pipeline.h"
#include "agent/uplink/known_servers.h"
#include "common/wire/server_list.h"
#include "rigcal/v1/ingest_service.pb.h"

namespace rigcal::agent {

struct UplinkOptions {
  // Of which one answers at a time.
  wire::ServerList servers = wire::ServerList::Of("");
  // Called with all of them when a server has named others. Unset: nobody keeps them.
  std::function<void(const wire::ServerList&)> learned = {};
  std::string agent_id;
  uint32_t incarnation = 1;   // grows at each start of the agent
  uint32_t stream_epoch = 1;  // of new observations; another one at each start
  std::string host;           // of this PC, for people
  // As AgentIdentity.
  std::string secret;
  std::string rig = "rig";
  // The spool keeps rows until the server's standby has them.
  bool keeps_until_standby = false;
  // Where KnownServers are kept; empty: nowhere.
  std::filesystem::path known_servers_file = {};

  // Rows of a full batch, and how long fewer rows wait to become one while the server keeps up
  // (DeliveryPlan). The server may ask for fewer.
  size_t max_batch_rows = 256;
  std::chrono::milliseconds flush_interval{20};
  std::chrono::milliseconds ping_interval{10'000};
  std::chrono::milliseconds report_interval{2'000};
  // A connection is given up when the server sends no hello, or nothing at all, for so long.
  std::chrono::milliseconds hello_timeout{10'000};
  std::chrono::milliseconds silence_timeout{60'000};
  // How long observations wait for the first answer to a ping, where their clock needs one.
  std::chrono::milliseconds alignment_timeout{1'000};
  // Between attempts: from lowest to highest with full jitter. After an error that only a person
  // can end (versions, a camera that another agent holds), always refused_wait.
  std::chrono::milliseconds lowest_wait{200};
  std::chrono::milliseconds highest_wait{30'000};
  std::chrono::milliseconds refused_wait{30'000};
  // While the server has no room for what is sent.
  std::chrono::milliseconds longest_wait_for_room{5'000};
  // With several servers, instead of the two above: one takes over within a second.
  std::chrono::milliseconds hello_timeout_of_several{3'000};
  std::chrono::milliseconds highest_wait_of_several{1'000};

  PreviewOptions previews;
  LearningOptions learning;
};

// The messages of one connection: what the agent sends, in which order, and how it follows what the
// server sends. Knows no network. For one thread.
//
// The agent sends its hello and nothing else until the server's hello has arrived; the server's
// hello is its first message and its only one.
class Conversation {
 public:
  using Clock = std::chrono::steady_clock;

  // Parts of the agent that outlive a connection.
  struct Agent {
    ObservationSpool* spool = nullptr;
    const CameraPipelines* cameras = nullptr;
    PreviewWorker* previews = nullptr;
    DetectorLearner* detectors = nullptr;
    CameraOffers* offers = nullptr;  // null: the agent offers nothing
    DeliveryPlan* plan = nullptr;
    KnownServers* known_servers = nullptr;  // null: none is remembered
    std::string server_id = {};             // of the server of the connection before; empty: none
  };

  // `connection`: grows at each connection of this incarnation. `options` and `agent` must outlive
  // the conversation.
  // `server` is the address of the server, for messages.
  Conversation(const UplinkOptions& options, std::string server, uint32_t connection, Agent* agent,
               Clock::time_point now)
      : options_(options),
        server_(std::move(server)),
        connection_(connection),
        agent_(*agent),
        start_(now) {}

  // The first message.
  v1::ConnectRequest Hello();
  // Follows a message of the server. An error ends the connection.
  absl::Status Handle(const v1::ConnectResponse& message, Clock::time_point now);
  // What to send next; none: nothing yet. Only once greeted.
  std::optional<v1::ConnectRequest> Next(Clock::time_point now);

  // As the server's hello has named them.
  const std::vector<std::string>& servers() const { return servers_; }
  bool greeted() const { return greeted_; }  // the server's hello has arrived
  // Something became durable, or the connection stood for so long that it is good even if nothing
  // had to be delivered.
  bool IsGood(Clock::time_point now) const {
    return progressed_ || now - start_ >= std::chrono::seconds(10);
  }
  // DEADLINE_EXCEEDED: the server has been silent for too long.
  absl::Status CheckTimeouts(Clock::time_point now) const;
  // When to call CheckTimeouts and Next again, whatever happens. `can_send`: a message could leave
  // now.
  Clock::time_point NextDeadline(Clock::time_point now, bool can_send) const;

 private:
  absl::Status HandleHello(const v1::ServerHello& hello);
  absl::Status HandleAck(const v1::BatchAck& proto, Clock::time_point now);
  void HandleStartCapture(const v1::StartCapture& command);
  void HandlePong(const v1::TimePong& pong);
  void HandlePreviewRequest(const v1::PreviewRequest& request);
  void HandleDetectorRequest(const v1::DetectorRequest& request);
  void HandleChoiceRequest(const v1::ChoiceRequest& request);
  // Answers about the offered cameras, and what is offered.
  std::optional<v1::ConnectRequest> NextOffer();
  void HandlePosition(const StreamKey& stream, const v1::StreamPosition& position);
  void BeginCapture(const StreamKey& stream, const Target& target, uint32_t durable_seq);
  std::optional<v1::ConnectRequest> NextReport();
  CameraReport ReportOf(const SpooledStream& spooled) const;
  // Null: the agent has no such camera.
  CameraPipeline* PipelineOf(const std::string& camera) const;

  const UplinkOptions& options_;
  const std::string server_;
  const uint32_t connection_;
  Agent& agent_;
  const Clock::time_point start_;

  std::vector<std::string> servers_;
  bool greeted_ = false;
  bool takes_offers_ = false;  // the server does
  bool progressed_ = false;    // something became durable
  Clock::time_point last_heard_ = start_;
  Clock::time_point next_ping_ = start_;
  Clock::time_point next_report_ = start_ + options_.report_interval;
  std::optional<int64_t> ping_ns_;  // of the ping that is not answered yet
  std::vector<StreamKey> pending_;  // as the agent's hello named them
  // Sessions that the server has started, and not stopped, on this connection. One that captures
  // here since an earlier connection and is not among them ended in between.
  std::set<std::string> live_sessions_;
  std::vector<SpooledStream> to_report_;  // in this round, as they were at its beginning
  // Of each stream, a sum that grows with everything in its reports, as of the last one.
  std::map<StreamKey, uint64_t> reported_;
};

}  // namespace rigcal::agent

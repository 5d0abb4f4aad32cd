// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "agent/capture/preview/preview_worker.h"
#include "agent/spool/delivery_plan.h"
#include "agent/uplink/capture_control.h"
#include "agent/uplink/uplink_options.h"
#include "rigcal/v1/ingest_service.pb.h"

namespace rigcal::agent {

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
    MemorySpool* spool = nullptr;
    CaptureControl* captures = nullptr;
    PreviewWorker* previews = nullptr;
    DeliveryPlan* plan = nullptr;
    std::string server_id = {};  // of the server of the connection before; empty: none
  };

  // `connection`: grows at each connection of this incarnation. `options` and `agent` must outlive
  // the conversation.
  Conversation(const UplinkOptions& options, uint32_t connection, Agent* agent,
               Clock::time_point now);

  // The first message.
  v1::ConnectRequest Hello();
  // Follows a message of the server. An error ends the connection.
  absl::Status Handle(const v1::ConnectResponse& message, Clock::time_point now);
  // What to send next; none: nothing yet. Only once greeted.
  std::optional<v1::ConnectRequest> Next(Clock::time_point now);

  bool greeted() const { return greeted_; }  // the server's hello has arrived
  // Something became durable, or the connection stood for a while.
  bool IsGood(Clock::time_point now) const;
  // DEADLINE_EXCEEDED: the server has been silent for too long.
  absl::Status CheckTimeouts(Clock::time_point now) const;
  // When to call CheckTimeouts and Next again, whatever happens. `can_send`: a message could leave
  // now.
  Clock::time_point NextDeadline(Clock::time_point now, bool can_send) const;

 private:
  absl::Status HandleHello(const v1::ServerHello& hello);
  absl::Status HandleAck(const v1::BatchAck& proto);
  void HandleStartCapture(const v1::StartCapture& command);
  void HandleStopCapture(const v1::StopCapture& command);
  void HandlePong(const v1::TimePong& pong);
  void HandlePreviewRequest(const v1::PreviewRequest& request);
  void HandlePosition(const StreamKey& stream, const v1::StreamPosition& position);
  void BeginCapture(const StreamKey& stream, const Target& target, uint32_t durable_seq);
  std::optional<v1::ConnectRequest> NextReport();

  const UplinkOptions& options_;
  const uint32_t connection_;
  Agent& agent_;
  const Clock::time_point start_;

  bool greeted_ = false;
  bool progressed_ = false;  // something became durable
  Clock::time_point last_heard_;
  Clock::time_point next_ping_;
  Clock::time_point next_report_;
  std::optional<int64_t> ping_ns_;  // of the ping that is not answered yet
  std::vector<StreamKey> pending_;  // as the agent's hello named them
  // Sessions that the server has started, and not stopped, on this connection. One that captures
  // here since an earlier connection and is not among them ended in between.
  std::set<std::string> live_sessions_;
  std::map<StreamKey, uint64_t> reported_;  // sum of what the last report of each stream counts
};

}  // namespace rigcal::agent

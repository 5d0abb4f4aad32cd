// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "agent/capture/preview/preview_worker.h"
#include "agent/spool/delivery_plan.h"
#include "agent/spool/observation_spool.h"
#include "agent/uplink/backoff.h"
#include "agent/uplink/capture_control.h"
#include "rigcal/v1/agent.pb.h"

namespace grpc {
class Channel;
}

namespace rigcal::agent {

class ServerConnection;

struct UplinkOptions {
  std::string server;  // its address, for messages
  std::string agent_id;
  uint32_t incarnation = 1;   // grows at each start of the agent
  uint32_t stream_epoch = 1;  // of new streams
  std::string host;           // of this PC, for people
  std::string rig = "rig";

  // Rows of a full batch, and how long fewer rows wait to become one. The server may ask for fewer.
  size_t max_batch_rows = 256;
  std::chrono::milliseconds flush_interval{20};
  std::chrono::milliseconds ping_interval{10'000};
  std::chrono::milliseconds report_interval{2'000};
  // A server that says nothing at all for so long, neither hello nor pong, is given up.
  std::chrono::milliseconds hello_timeout{10'000};
  std::chrono::milliseconds silence_timeout{60'000};
  // How long observations wait for the first answer to a ping, where their clock needs one.
  std::chrono::milliseconds alignment_timeout{1'000};
  // Between attempts: from lowest to highest with full jitter. After an error that only a person
  // can end (versions, a camera that another agent holds), always refused_wait.
  std::chrono::milliseconds lowest_wait{200};
  std::chrono::milliseconds highest_wait{30'000};
  std::chrono::milliseconds refused_wait{30'000};

  PreviewOptions previews;

  // INVALID_ARGUMENT with every fault.
  absl::Status Validate() const;
};

// The way to the server: keeps one stream to it, connecting again for as long as the agent lives;
// passes the server's commands to the cameras and what the spool holds to the server, from behind
// what is durable there. One thread does all of it.
class Uplink {
 public:
  // A fresh channel for each attempt, so that how often to try is decided here alone.
  using ChannelFactory = std::function<std::shared_ptr<grpc::Channel>()>;

  // A channel to `address` (HOST:PORT) with keepalive, for ChannelFactory.
  static std::shared_ptr<grpc::Channel> MakeChannel(const std::string& address);

  // `spool` outlives the uplink. `sources` are the agent's cameras.
  static absl::StatusOr<std::unique_ptr<Uplink>> Create(
      UplinkOptions options, std::vector<std::unique_ptr<ObservationSource>> sources,
      ObservationSpool* spool, ChannelFactory make_channel);
  ~Uplink();
  Uplink(const Uplink&) = delete;
  Uplink& operator=(const Uplink&) = delete;

  void Start();
  // Ends every capture, delivers what is there for at most `patience`, and disconnects. Returns how
  // many observations were not acknowledged by then; they are lost with a spool in memory.
  uint32_t Shutdown(std::chrono::milliseconds patience);

 private:
  using Clock = std::chrono::steady_clock;

  // What is known of the connection that stands.
  struct Connected {
    std::unique_ptr<ServerConnection> connection;
    bool greeted = false;  // ServerHello has come
    Clock::time_point start;
    Clock::time_point last_heard;
    Clock::time_point next_ping;
    Clock::time_point next_report;
    std::optional<int64_t> ping_ns;  // the ping that is not answered yet
    bool progressed = false;         // something became durable
    absl::Status fault;              // found here, ends the connection
  };

  Uplink(UplinkOptions options, ObservationSpool* spool, ChannelFactory make_channel);

  void Run();
  absl::Status Serve(Connected& connected);
  Backoff::Duration WaitAfter(const Connected& connected, const absl::Status& status);
  void Handle(Connected& connected, const v1::ServerMessage& message);
  void HandleHello(Connected& connected, const v1::ServerHello& hello);
  void HandleStartCapture(const v1::StartCapture& command);
  void HandleStopCapture(const v1::StopCapture& command);
  void HandleAck(Connected& connected, const v1::BatchAck& ack);
  void HandlePong(Connected& connected, const v1::TimePong& pong);
  void HandlePreviewRequest(const v1::PreviewRequest& request);
  void HandlePosition(const StreamKey& stream, const v1::StreamPosition& position);
  void BeginCapture(const StreamKey& stream, const Target& target, uint32_t durable_seq);
  std::optional<v1::AgentMessage> NextMessage(Connected& connected);
  std::optional<v1::AgentMessage> NextReport();
  v1::AgentMessage MakeHello();
  absl::Status CheckTimeouts(const Connected& connected) const;
  Clock::time_point NextDeadline(const Connected& connected) const;

  void Wake();
  // Until Wake or `deadline`.
  void WaitUntil(Clock::time_point deadline);
  bool IsTimeToLeave() const;  // shutting down, and all is delivered or patience is at its end

  const UplinkOptions options_;
  ObservationSpool* const spool_;
  const ChannelFactory make_channel_;
  std::unique_ptr<CaptureControl> captures_;
  std::unique_ptr<PreviewWorker> previews_;  // uses the sources of captures_
  DeliveryPlan plan_;
  Backoff backoff_;
  uint32_t connection_ = 0;
  std::string server_id_;
  std::vector<StreamKey> pending_;  // as the hello of this connection named them
  // Sessions the server has told to capture, and not to stop, on this connection. One that captures
  // here from an earlier connection and is not among them ended while this agent was away.
  std::set<std::string> live_sessions_;
  std::map<StreamKey, uint64_t> reported_;  // sum of what the last report of each stream counts
  std::string last_error_;                  // not to repeat it at each attempt

  mutable std::mutex mutex_;
  std::condition_variable woken_changed_;
  bool woken_ = false;
  std::optional<Clock::time_point> leave_by_;  // set: shutting down
  std::thread thread_;
};

}  // namespace rigcal::agent

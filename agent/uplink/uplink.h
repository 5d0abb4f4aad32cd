// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/capture/preview/preview_worker.h"
#include "agent/spool/delivery_plan.h"
#include "agent/stamp/camera_pipeline.h"
#include "agent/uplink/backoff.h"
#include "agent/uplink/conversation.h"

namespace grpc {
class Channel;
}

namespace rigcal::agent {

// Keeps one stream to the server, and connects again for as long as the agent runs. Conversation
// decides what is sent over a connection and follows the server's commands. One thread does all of
// it.
class Uplink {
 public:
  // A fresh channel for each attempt, so that how often to try is decided here alone.
  using ChannelFactory = std::function<std::shared_ptr<grpc::Channel>()>;

  // A channel to `address` (HOST:PORT) with keepalive, for ChannelFactory.
  static std::shared_ptr<grpc::Channel> MakeChannel(const std::string& address);

  // `spool` outlives the uplink. `sources` are the agent's cameras. INVALID_ARGUMENT as for
  // MakePipelines.
  static absl::StatusOr<std::unique_ptr<Uplink>> Create(
      UplinkOptions options, std::vector<std::unique_ptr<ObservationSource>> sources,
      MemorySpool* spool, ChannelFactory make_channel);
  ~Uplink() { Shutdown(std::chrono::milliseconds(0)); }
  Uplink(const Uplink&) = delete;
  Uplink& operator=(const Uplink&) = delete;

  void Start();
  // Ends every capture, delivers what the spool holds for at most `patience`, and disconnects.
  // Returns how many observations were not acknowledged by then; with a spool in memory they are
  // lost.
  uint32_t Shutdown(std::chrono::milliseconds patience);

 private:
  using Clock = std::chrono::steady_clock;

  Uplink(UplinkOptions options, MemorySpool* spool, ChannelFactory make_channel);

  void Run();
  absl::Status Serve(Conversation& conversation);
  Backoff::Duration WaitAfter(const Conversation& conversation, const absl::Status& status);

  void Wake();
  // Until Wake or `deadline`.
  void WaitUntil(Clock::time_point deadline);
  bool IsTimeToLeave() const;  // shutting down, and all is delivered or patience is at its end

  const UplinkOptions options_;
  MemorySpool* const spool_;
  const ChannelFactory make_channel_;
  CameraPipelines cameras_;
  std::unique_ptr<PreviewWorker> previews_;  // uses the sources of cameras_
  DeliveryPlan plan_;
  Backoff backoff_;
  Conversation::Agent agent_;
  uint32_t connection_ = 0;
  std::string last_error_;  // not to repeat it at each attempt

  mutable std::mutex mutex_;
  std::condition_variable woken_changed_;
  bool woken_ = false;
  std::optional<Clock::time_point> leave_by_;  // set: shutting down
  std::thread thread_;
};

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <condition_variable>
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

#include "absl/status/statusor.h"
#include "agent/capture/learning/detector_learner.h"
#include "agent/capture/preview/preview_worker.h"
#include "agent/offer/camera_offers.h"
#include "agent/spool/delivery_plan.h"
#include "agent/stamp/camera_pipeline.h"
#include "agent/uplink/backoff.h"
#include "agent/uplink/conversation.h"
#include "common/wire/server_access.h"

namespace grpc {
class Channel;
}

namespace rigcal::agent {

class UplinkConnection;

// Observations that were not acknowledged when the agent ended.
struct LeftBehind {
  uint64_t row_count = 0;
  std::set<std::string> cameras;
};

// Keeps one stream to the server, or to the one of several that answers, and connects again for as
// long as the agent runs. Conversation
// decides what is sent over a connection and follows the server's commands. One thread does all of
// it.
class Uplink {
 public:
  // A fresh channel for each attempt, so that how often to try is decided here alone.
  // `of_several`: as for MakeChannel.
  using ChannelFactory =
      std::function<std::shared_ptr<grpc::Channel>(const std::string& server, bool of_several)>;

  // A channel to `address` (HOST:PORT, or unix:PATH) with keepalive, for ChannelFactory. To another
  // machine with the files of `identity`, as they are now; where they cannot be used, that is
  // logged, and the channel gives INVALID_ARGUMENT.
  // `of_several`: another server answers where this one is away, so that is found out soon.
  static std::shared_ptr<grpc::Channel> MakeChannel(const std::string& address,
                                                    const wire::ClientIdentity& identity = {},
                                                    bool of_several = false);

  // `spool` outlives the uplink. `sources` are the agent's cameras; `offers`, where there are any,
  // changes them while it runs. INVALID_ARGUMENT as for MakePipelines.
  static absl::StatusOr<std::unique_ptr<Uplink>> Create(
      UplinkOptions options, std::vector<std::unique_ptr<ObservationSource>> sources,
      ObservationSpool* spool, ChannelFactory make_channel,
      std::unique_ptr<CameraOffers> offers = nullptr);
  ~Uplink() { Shutdown(std::chrono::milliseconds(0)); }
  Uplink(const Uplink&) = delete;
  Uplink& operator=(const Uplink&) = delete;

  void Start();
  // Leaves the connection for a new one, which uses a renewed certificate. What is not acknowledged
  // is delivered again. From any thread.
  void Reconnect();
  // Ends every capture, delivers what the spool holds for at most `patience`, and disconnects.
  // Returns what was not acknowledged by then; with a spool in memory it is lost.
  LeftBehind Shutdown(std::chrono::milliseconds patience);

 private:
  using Clock = std::chrono::steady_clock;

  Uplink(UplinkOptions options, ObservationSpool* spool, ChannelFactory make_channel);

  void Run();
  void LearnServers(const Conversation& conversation);
  // OK: it is time to leave, or to connect again.
  absl::Status Serve(Conversation& conversation);
  // Tells the server that this connection ends, and waits for its end for a moment.
  void Leave(UplinkConnection& connection);
  // Makes what serves the cameras as they are now.
  void ServeCameras();
  // Makes the change of cameras that the offers have, if they have one.
  void ChangeCameras();
  absl::Status Make(CameraOffers::Change change);
  absl::Status CheckDrop(const std::string& camera) const;
  bool IsCapturing() const;
  Backoff::Duration WaitAfter(const Conversation& conversation, const absl::Status& status);

  void Wake();
  // Until Wake or `deadline`.
  void WaitUntil(Clock::time_point deadline);
  bool TakeReconnect();
  bool IsTimeToLeave() const;  // shutting down, and all is delivered or patience is at its end

  UplinkOptions options_;
  ObservationSpool* const spool_;
  const ChannelFactory make_channel_;
  // Changed by thread_ alone, with this mutex, which others hold to read them.
  mutable std::mutex cameras_mutex_;
  CameraPipelines cameras_;
  bool cameras_changed_ = false;  // since the hello of this connection
  // These two use the sources of cameras_.
  std::unique_ptr<PreviewWorker> previews_;
  std::unique_ptr<DetectorLearner> detectors_;
  std::unique_ptr<CameraOffers> offers_;  // null: none
  DeliveryPlan plan_;
  Backoff backoff_;
  std::optional<KnownServers> known_servers_;
  Conversation::Agent agent_;
  uint32_t connection_ = 0;
  wire::ServerList servers_;
  std::string active_server_;                      // as the last connection has named it
  std::map<std::string, std::string> last_error_;  // by server, not to repeat it at each attempt

  mutable std::mutex mutex_;
  std::condition_variable woken_changed_;
  bool woken_ = false;
  bool reconnect_ = false;
  std::optional<Clock::time_point> leave_by_;  // set: shutting down
  std::thread thread_;
};

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "absl/status/statusor.h"
#include "server/ingest/ingest.h"
#include "server/live/live_state.h"
#include "server/session/agent_directory.h"
#include "server/session/session_coordinator.h"
#include "server/store/store.h"

namespace rigcal::server {

struct LiveTrackerOptions {
  // The state is made at most this often.
  std::chrono::milliseconds interval{100};
  // Unset: the system's clocks. For tests, which call Update themselves.
  std::function<int64_t()> utc_now_ns = {};
  std::function<std::chrono::steady_clock::time_point()> steady_now = {};
};

// Follows what ingest stores, sessions, agents and the running estimate, and makes the live state
// of each rig: at most ten times a second, on one thread, whoever asks for it. Memory is bounded:
// rows are thinned to about 50 per second and camera, and cameras beyond the first 256 of a session
// are left out. Thread-safe.
class LiveTracker {
 public:
  // What is given to whoever collects rows for an estimate.
  using RowTap = std::function<void(const StreamKey&, const ObservationBatch&)>;

  // All must outlive the tracker. Reads the counts of sessions that run from `store`, so it is made
  // before ingest starts.
  LiveTracker(LiveTrackerOptions options, Store* store, const AgentDirectory* directory,
              SessionCoordinator* coordinator);
  ~LiveTracker();  // shuts down

  // `tap` gets every batch of rows that became durable, on the ingest writer's thread: it must be
  // very cheap. Before ingest starts.
  void SetRowTap(RowTap tap);
  void Start();
  void Shutdown();

  // The DeliveryHook of Ingest. On the writer's thread; takes microseconds.
  void RecordDelivery(const Delivery& delivery, const AppendOutcome& outcome);
  // The running estimate of `estimate.session_id`. Shown while that is the session of its rig.
  void SetEstimate(LiveEstimate estimate);

  // The newest state of a rig; never null. A rig that nobody knows has an empty one.
  std::shared_ptr<const LiveSnapshot> Get(std::string_view rig);
  // Makes the states now. Called by the tracker's own thread; by tests instead of Start.
  void Update();
};

}  // namespace rigcal::server

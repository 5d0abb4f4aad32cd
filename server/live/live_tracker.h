// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
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
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "server/ingest/ingest.h"
#include "server/live/arrivals.h"
#include "server/live/earlier_waves.h"
#include "server/live/live_state.h"
#include "server/session/agent_directory.h"
#include "server/session/session_coordinator.h"
#include "server/session/task_queue.h"
#include "server/store/store.h"

namespace rigcal::server {

struct LiveTrackerOptions {
  // The state is made at most this often: a little more often than pages ask.
  std::chrono::milliseconds interval{220};
  // Unset: the system's clocks. For tests, which call Update themselves.
  std::function<int64_t()> utc_now_ns = {};
  std::function<std::chrono::steady_clock::time_point()> steady_now = {};
};

// Follows what ingest stores, sessions, agents and the running estimate, and makes the live state
// of each rig: at most once per interval, on one thread, for all clients. Memory is bounded:
// rows are thinned to about 50 per second and camera, and cameras beyond the first 256 of a session
// are left out. Thread-safe.
class LiveTracker {
 public:
  // What is given to whoever collects rows for an estimate.
  using RowTap = std::function<void(const StreamKey&, const ObservationBatch&)>;
  // The same for rows from before: the session that captures, the camera as it was in the session
  // of the rows, and rows.
  using EarlierTap = std::function<void(const std::string& session_id, const SessionCamera& camera,
                                        const ObservationBatch& rows)>;

  // All must outlive the tracker. Reads the counts of sessions that run from `store`, so it is made
  // before ingest starts.
  LiveTracker(LiveTrackerOptions options, Store* store, const AgentDirectory* directory,
              SessionCoordinator* coordinator);
  ~LiveTracker();  // shuts down

  // `tap` gets every batch of rows that became durable, without refused ones, on the ingest
  // writer's thread: it must be very cheap. Before ingest starts.
  void SetRowTap(RowTap tap);
  // `tap` gets the rows of the sessions that a session continues, and after a restart its own, once
  // when it begins to capture, on a thread for that. Before Start.
  void SetEarlierTap(EarlierTap tap);
  void Start();
  void Shutdown();

  // The DeliveryHook of Ingest. On the writer's thread; takes microseconds.
  void RecordDelivery(const Delivery& delivery, const AppendOutcome& outcome);
  // The running estimate of `estimate.session_id`. Shown while that is the session of its rig.
  void SetEstimate(LiveEstimate estimate);
  // The monitor's state of a rig. Kept where the rig is not known yet.
  void SetMonitor(const std::string& rig, LiveMonitor monitor);

  // Rows that the session has from before are still being read: what is estimated without them is
  // worse than what was shown before a restart.
  bool ReadsEarlier(std::string_view session_id) const;

  // The newest state of a rig; never null. A rig that nobody knows has an empty one.
  std::shared_ptr<const LiveSnapshot> Get(std::string_view rig) const;
  // Makes the states now. Called by the tracker's own thread; by tests instead of Start.
  void Update();
  // Returns when sessions that have reached their goal have been told to stop, and earlier waves
  // have been read. Between Start and Shutdown.
  void WaitIdle() {
    stops_.WaitIdle();
    reading_.WaitIdle();
  }

 private:
  using Time = std::chrono::steady_clock::time_point;
  struct Rig;

  Time Now() const;
  int64_t UtcNow() const;
  void Run();
  Rig* FindOrAddRig(std::string_view name);
  void FollowSessions();
  void FollowSession(Rig* rig, std::string_view id);
  void ReadEarlier(const Session& session, const std::vector<SessionCameraCounts>& own_counts);
  void FollowAgents();
  void TakeArrivals(std::vector<std::pair<StreamKey, Arrivals>> arrivals);
  void TakeEarlier();
  void TakeEstimates();
  void TakeMonitors();
  void Publish(Rig* rig);
  void StopAtGoal(Rig* rig, const LiveGoal& goal);
  std::shared_ptr<const LiveSnapshot> EmptyState(std::string_view rig) const;
  std::string IncarnationOf(std::string_view rig) const;

  const LiveTrackerOptions options_;
  Store* const store_;
  const AgentDirectory* const directory_;
  SessionCoordinator* const coordinator_;
  const uint64_t incarnation_;
  const int64_t begin_utc_ns_;
  RowTap row_tap_;
  EarlierTap earlier_tap_;
  ArrivalInbox inbox_;

  // Held over an update.
  std::mutex update_mutex_;
  std::map<std::string, std::unique_ptr<Rig>, std::less<>> rigs_;
  uint64_t last_revision_ = 0;
  std::optional<uint64_t> change_count_;
  std::optional<Time> agents_time_;
  std::optional<Time> health_time_;
  StoreHealth health_;
  std::set<std::string, std::less<>> read_sessions_;  // of which earlier waves have been tapped

  // Held briefly.
  mutable std::mutex mutex_;
  std::map<std::string, std::shared_ptr<const LiveSnapshot>, std::less<>> published_;
  std::map<std::string, std::shared_ptr<const LiveEstimate>, std::less<>> estimates_;
  std::map<std::string, std::shared_ptr<const LiveMonitor>, std::less<>> monitors_;  // by rig
  std::map<std::string, EarlierCounts, std::less<>> earlier_;  // by session, not yet taken
  std::multiset<std::string, std::less<>> reading_sessions_;   // once for each reading
  std::condition_variable wake_;
  std::atomic<bool> stopping_ = false;

  // Their tasks use the members above.
  TaskQueue stops_{"live goals"};
  TaskQueue reading_{"earlier waves"};
  std::thread thread_;
};

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "common/session/session.h"
#include "server/estimate/row_collection.h"
#include "server/jobs/estimate_in_worker.h"
#include "server/live/live_state.h"
#include "server/store/store.h"

namespace rigcal::server {

struct EstimateLoopOptions {
  // So old is an estimate of a session at most when its next one is ready, where the machine can:
  // the next one starts as much earlier as the last one took, but not before half of this.
  std::chrono::milliseconds max_age{2'000};
  size_t max_history = 300;
};

// Keeps a running estimate of every session that captures: one after the other, on one thread,
// whenever rows have arrived since the last one. What fails or throws is logged, shown and tried
// again. The rows and the start of the next estimate are kept until the session has ended or is
// gone, whatever the store says meanwhile.
class EstimateLoop {
 public:
  // `store` must outlive the loop. `show` gets each estimate.
  EstimateLoop(EstimateLoopOptions options, const Store* store, EstimateFunction estimate,
               std::function<void(LiveEstimate)> show);
  ~EstimateLoop();  // shuts down

  // A tap of LiveTracker: rows that became durable.
  void AddRows(const StreamKey& stream, const ObservationBatch& batch) { rows_.Add(stream, batch); }
  // The same for rows from before (LiveTracker::EarlierTap).
  void AddEarlierRows(const std::string& session_id, const SessionCamera& camera,
                      const ObservationBatch& rows) {
    rows_.AddEarlier(session_id, camera, rows);
  }
  // Sessions for which this is true wait with their estimate: more rows are on their way. Before
  // Start; called by the loop's thread.
  void SetWaits(std::function<bool(const std::string& session_id)> waits) {
    waits_ = std::move(waits);
  }
  void Start();
  // Ends the estimate that is being made.
  void Shutdown();

 private:
  using Time = std::chrono::steady_clock::time_point;
  struct Progress {
    EstimateStart start;
    LiveEstimate shown;
    uint64_t seen_count = 0;
    std::string store_problem;  // logged already
    Time next{};
  };

  void Run();
  void EstimateSession(const std::string& id);
  void ShowFault(const std::string& id, const absl::Status& fault);
  bool WaitUntil(Time time);

  const EstimateLoopOptions options_;
  const Store* const store_;
  const EstimateFunction estimate_;
  const std::function<void(LiveEstimate)> show_;
  std::function<bool(const std::string&)> waits_;
  RowCollection rows_;
  std::map<std::string, Progress> progress_;  // of the loop's thread
  std::atomic<bool> stopping_ = false;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::thread thread_;
};

}  // namespace rigcal::server

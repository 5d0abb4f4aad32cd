// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

#include "absl/status/status.h"
#include "server/store/store.h"

namespace rigcal::server {

// Keeps the claim on a job while it is solved, from a thread of its own: each third of the lease,
// so that two heartbeats may fail, and soon after a stage has begun. A store that is gone costs
// nothing but the heartbeats; the fencing number decides afterwards.
class JobHeartbeat {
 public:
  struct Events {
    std::function<void()> cancel;                   // asked for by a client
    std::function<void(const absl::Status&)> lost;  // another process has the job; the last event
  };

  // `store` outlives it.
  JobHeartbeat(Store* store, JobClaim claim, Events events);
  // No event comes after this.
  ~JobHeartbeat();
  JobHeartbeat(const JobHeartbeat&) = delete;
  JobHeartbeat& operator=(const JobHeartbeat&) = delete;

  void Report(const JobProgress& progress);

 private:
  void Run();

  Store* const store_;
  const JobClaim claim_;
  const Events events_;
  std::mutex mutex_;
  std::condition_variable wake_;
  JobProgress progress_;
  bool is_due_ = false;
  bool stopping_ = false;
  std::thread thread_;  // uses the members above
};

}  // namespace rigcal::server

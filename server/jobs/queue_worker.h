// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "server/session/job_solver.h"
#include "server/store/store.h"

namespace rigcal::server {

struct QueueWorkerOptions {
  JobSolverOptions solver;
  int jobs = 1;  // calibrations at a time
};

// Solves calibrations from the queue of a store that a server has elsewhere, and says that it
// lives. While the store cannot be reached it waits. Thread-safe.
class QueueWorker {
 public:
  // `store` outlives it.
  QueueWorker(QueueWorkerOptions options, Store* store, SolveFunction solve);
  ~QueueWorker();
  QueueWorker(const QueueWorker&) = delete;
  QueueWorker& operator=(const QueueWorker&) = delete;

  void Start();
  // Gives back what it solves at once, and takes its name from the list of workers.
  void Shutdown();

 private:
  void TakeJobs(JobSolver* solver);
  void SayItLives();
  // False: it ends.
  bool Pause(std::chrono::milliseconds time);

  const QueueWorkerOptions options_;
  Store* const store_;
  std::vector<std::unique_ptr<JobSolver>> solvers_;
  std::mutex mutex_;
  std::condition_variable wake_;
  bool stopping_ = false;
  std::vector<std::thread> threads_;  // use the members above
};

}  // namespace rigcal::server

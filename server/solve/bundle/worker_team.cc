// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/worker_team.h"

namespace rigcal::server {

WorkerTeam::WorkerTeam(int thread_count) {
  for (int i = 1; i < thread_count; ++i) threads_.emplace_back([this] { Work(); });
}

WorkerTeam::~WorkerTeam() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  begin_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void WorkerTeam::TakeTasks() {
  for (int task = next_.fetch_add(1); task < count_; task = next_.fetch_add(1)) (*task_)(task);
}

void WorkerTeam::Run(int count, const std::function<void(int)>& task) {
  if (threads_.empty() || count < 2) {
    for (int i = 0; i < count; ++i) task(i);
    return;
  }
  {
    const std::lock_guard lock(mutex_);
    task_ = &task;
    count_ = count;
    next_ = 0;
    working_ = static_cast<int>(threads_.size());
    ++round_;
  }
  begin_.notify_all();
  TakeTasks();
  std::unique_lock lock(mutex_);
  end_.wait(lock, [this] { return working_ == 0; });
}

void WorkerTeam::Work() {
  uint64_t round = 0;
  while (true) {
    {
      std::unique_lock lock(mutex_);
      begin_.wait(lock, [this, round] { return ending_ || round_ != round; });
      if (ending_) return;
      round = round_;
    }
    TakeTasks();
    const std::lock_guard lock(mutex_);
    if (--working_ == 0) end_.notify_one();
  }
}

}  // namespace rigcal::server

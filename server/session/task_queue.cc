// SPDX-License-Identifier: Apache-2.0
#include "server/session/task_queue.h"

#include <spdlog/spdlog.h>

#include <exception>
#include <utility>

namespace rigcal::server {

void TaskQueue::Start() {
  std::lock_guard lock(mutex_);
  if (!thread_.joinable() && !stopping_) thread_ = std::thread([this] { Run(); });
}

void TaskQueue::Shutdown() {
  {
    std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  idle_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void TaskQueue::Post(Task task) {
  {
    std::lock_guard lock(mutex_);
    tasks_.push_back(std::move(task));
  }
  wake_.notify_all();
}

void TaskQueue::PostAt(Time due, Task task) {
  {
    std::lock_guard lock(mutex_);
    later_.emplace(due, std::move(task));
  }
  wake_.notify_all();
}

void TaskQueue::WaitIdle() {
  std::unique_lock lock(mutex_);
  idle_.wait(lock, [this] { return stopping_ || (tasks_.empty() && !running_); });
}

void TaskQueue::Run() {
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    while (!later_.empty() && later_.begin()->first <= std::chrono::steady_clock::now()) {
      tasks_.push_back(std::move(later_.begin()->second));
      later_.erase(later_.begin());
    }
    if (tasks_.empty()) {
      idle_.notify_all();
      if (later_.empty()) {
        wake_.wait(lock);
      } else {
        const Time next = later_.begin()->first;  // a copy: the map may change meanwhile
        wake_.wait_until(lock, next);
      }
      continue;
    }
    Task task = std::move(tasks_.front());
    tasks_.pop_front();
    running_ = true;
    lock.unlock();
    try {
      task();
    } catch (const std::exception& error) {
      spdlog::error("{}: an unexpected fault: {}", name_, error.what());
    }
    task = nullptr;  // what it holds must not be destroyed under the lock
    lock.lock();
    running_ = false;
  }
}

}  // namespace rigcal::server

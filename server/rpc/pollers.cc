// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/pollers.h"

#include <algorithm>

namespace rigcal::server {
namespace {

constexpr int kPollers = 6;
constexpr std::chrono::seconds kHelp{2};

}  // namespace

size_t Pollers::OwnThreadsOfGrpc() {
  return std::clamp<size_t>(std::thread::hardware_concurrency() / 2, 2, 16);
}

void Pollers::AddTo(grpc::ServerBuilder* builder) {
  for (int i = 0; i < kPollers; ++i) queues_.push_back(builder->AddCompletionQueue());
}

void Pollers::Start() {
  for (const auto& queue : queues_) {
    threads_.emplace_back([this, queue = queue.get()] { Run(queue); });
  }
}

void Pollers::Help() {
  const std::lock_guard lock(mutex_);
  help_until_ = Clock::now() + kHelp;
  changed_.notify_all();
}

void Pollers::Run(grpc::ServerCompletionQueue* queue) {
  while (true) {
    Clock::duration left{0};
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [&] {
        left = help_until_ - Clock::now();
        return stopping_ || left > Clock::duration(0);
      });
      if (stopping_) return;
    }
    // Nothing is ever asked of these queues: who waits for their next event serves connections.
    void* tag = nullptr;
    bool ok = false;
    queue->AsyncNext(&tag, &ok,
                     std::chrono::system_clock::now() +
                         std::chrono::duration_cast<std::chrono::milliseconds>(left));
  }
}

void Pollers::Shutdown() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    changed_.notify_all();
  }
  for (const auto& queue : queues_) queue->Shutdown();
  for (std::thread& thread : threads_) thread.join();
  // A queue must be empty before it goes.
  for (const auto& queue : queues_) {
    void* tag = nullptr;
    bool ok = false;
    while (queue->Next(&tag, &ok)) {
    }
  }
  threads_.clear();
  queues_.clear();
}

}  // namespace rigcal::server

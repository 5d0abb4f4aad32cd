// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/pollers.h"

namespace rigcal::server {
namespace {

constexpr int kPollers = 6;

}  // namespace

void Pollers::AddTo(grpc::ServerBuilder* builder) {
  for (int i = 0; i < kPollers; ++i) queues_.push_back(builder->AddCompletionQueue());
}

void Pollers::Start() {
  for (const auto& queue : queues_) {
    // Nothing is ever asked of these queues: who waits for their next event serves connections.
    threads_.emplace_back([queue = queue.get()] {
      void* tag = nullptr;
      bool ok = false;
      while (queue->Next(&tag, &ok)) {
      }
    });
  }
}

void Pollers::Shutdown() {
  for (const auto& queue : queues_) queue->Shutdown();
  for (std::thread& thread : threads_) thread.join();
  // A queue must be empty before it goes, also where no thread has emptied it.
  for (const auto& queue : queues_) {
    void* tag = nullptr;
    bool ok = false;
    while (threads_.empty() && queue->Next(&tag, &ok)) {
    }
  }
  threads_.clear();
  queues_.clear();
}

}  // namespace rigcal::server

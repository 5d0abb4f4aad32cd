// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/completion_queue.h>
#include <grpcpp/server_builder.h>

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

namespace rigcal::server {

// More threads that read connections, for when those of gRPC are held. gRPC 1.51 has one for two
// cores, at least two, for servers with callbacks, and a thread parses all that a connection has
// sent before it looks at another: on two cores, two clients whose headers never end would keep
// everybody else waiting.
//
// They do not read all the time: a thread that has read something wakes the next one of those that
// wait, which costs more than a small message does otherwise.
class Pollers {
 public:
  ~Pollers() { Shutdown(); }

  // How many threads of gRPC's own read connections.
  static size_t OwnThreadsOfGrpc();

  void AddTo(grpc::ServerBuilder* builder);
  // After the server is started.
  void Start();
  // They read for two seconds from now on. From any thread.
  void Help();
  // After the server's shutdown.
  void Shutdown();

 private:
  using Clock = std::chrono::steady_clock;

  void Run(grpc::ServerCompletionQueue* queue);

  std::vector<std::unique_ptr<grpc::ServerCompletionQueue>> queues_;
  std::vector<std::thread> threads_;
  std::mutex mutex_;
  std::condition_variable changed_;
  Clock::time_point help_until_ = {};
  bool stopping_ = false;
};

}  // namespace rigcal::server

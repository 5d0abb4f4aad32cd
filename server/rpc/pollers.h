// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/completion_queue.h>
#include <grpcpp/server_builder.h>

#include <memory>
#include <thread>
#include <vector>

namespace rigcal::server {

// More threads that read connections. gRPC 1.51 has one per core for servers with callbacks, and a
// thread parses all that a connection has sent before it looks at another: on two cores, two
// clients whose headers never end would keep everybody else waiting. Not for several threads.
class Pollers {
 public:
  ~Pollers() { Shutdown(); }

  void AddTo(grpc::ServerBuilder* builder);
  // After the server is started.
  void Start();
  // After the server's shutdown.
  void Shutdown();

 private:
  std::vector<std::unique_ptr<grpc::ServerCompletionQueue>> queues_;
  std::vector<std::thread> threads_;
};

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/support/server_callback.h>

#include <chrono>
#include <cstddef>
#include <memory>
#include <mutex>
#include <set>
#include <vector>

#include "common/session/observation_batch.h"
#include "rigcal/v1/session_service.pb.h"
#include "server/session/session_coordinator.h"
#include "server/session/task_queue.h"
#include "server/store/store.h"

namespace rigcal::server {

struct ObservationReaderOptions {
  // Clients that read observations at a time.
  size_t max_readers = 16;
  // A client that takes nothing for so long is cut off.
  std::chrono::milliseconds stall_limit{10'000};
};

// Serves SessionService.ReadObservations from one thread, however many clients read and however
// slowly: a stream has one piece of the store and one message in memory, and holds no thread while
// its client does not read. Thread-safe.
class ObservationReaders {
 public:
  using Reactor = grpc::ServerWriteReactor<v1::ReadObservationsResponse>;

  ObservationReaders(ObservationReaderOptions options, const Store* store,
                     SessionCoordinator* coordinator);
  // All streams must have ended: after the gRPC server's shutdown.
  ~ObservationReaders();

  // Errors of the stream: NOT_FOUND (session, camera), RESOURCE_EXHAUSTED (too many readers),
  // DEADLINE_EXCEEDED (the client takes nothing), UNAVAILABLE (shutdown), and the store's.
  Reactor* Open(grpc::CallbackServerContext* context, const v1::ReadObservationsRequest& request);
  // Ends every stream with UNAVAILABLE; no new ones begin. Does not wait for them.
  void EndStreams();
  size_t count() const;

 private:
  class Stream;

  // False: the server is shutting down, or there are as many as may be.
  absl::Status Add(const std::shared_ptr<Stream>& stream);
  void Remove(const std::shared_ptr<Stream>& stream);

  const ObservationReaderOptions options_;
  const Store& store_;
  SessionCoordinator& coordinator_;
  mutable std::mutex mutex_;
  std::set<std::shared_ptr<Stream>> streams_;
  bool ending_ = false;
  TaskQueue tasks_{"readers"};  // its tasks use the members above
};

// A batch as several, each of which makes a message of about 1 MiB at most: rows in their order,
// then what clock samples and alignments are left.
std::vector<ObservationBatch> CutToMessages(ObservationBatch batch);

}  // namespace rigcal::server

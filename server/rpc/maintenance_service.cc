// SPDX-License-Identifier: Apache-2.0
#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include "common/wire/request_traits.h"
#include "rigcal/v1/maintenance_service.grpc.pb.h"
#include "server/rpc/call_guard.h"
#include "server/rpc/services.h"
#include "server/session/task_queue.h"

namespace rigcal::server {
namespace {

// Streams that are open at a time: one that compacts, and those that were not yet read to their
// end.
constexpr size_t kMaxCompactStreams = 8;

// Compacting runs on a thread of its own, one at a time, and its streams are served by the hub: a
// call holds no thread of the server, whether its client reads or not.
class MaintenanceService final
    : public v1::MaintenanceService::WithCallbackMethod_Compact<v1::MaintenanceService::Service> {
 public:
  MaintenanceService(Store* store, WatchHub* watches) : store_(*store), watches_(*watches) {
    tasks_.Start();
  }

  grpc::ServerWriteReactor<v1::CompactResponse>* Compact(
      grpc::CallbackServerContext*, const v1::CompactRequest* request) override {
    if (const absl::Status fault = wire::FaultOf(*request); !fault.ok()) {
      return new RefusedWatch<v1::CompactResponse>(fault);
    }
    if (compacting_.exchange(true)) {
      return new RefusedWatch<v1::CompactResponse>(absl::FailedPreconditionError(
          "the database is being compacted already; wait for the end of that"));
    }
    auto progress = std::make_shared<Progress>();
    tasks_.Post([this, client = std::weak_ptr(progress)] { Run(client); });
    return watches_.Open<v1::CompactResponse>(
        [&](std::function<void()> wake) { return changes_.Add("", std::move(wake)); },
        [this, progress = std::move(progress)](v1::CompactResponse* response) {
          return Read(*progress, response);
        });
  }

 private:
  // Lives as long as the stream of the client that asked.
  struct Progress {
    std::mutex mutex;
    double fraction = 0;
    std::optional<absl::Status> end;
  };

  void Run(const std::weak_ptr<Progress>& client) {
    const absl::Status end = wire::FromGrpc(GuardedCall("Compact", [&] {
      return store_.Compact([&](double fraction) {
        const std::shared_ptr<Progress> progress = client.lock();
        if (!progress) return absl::CancelledError("the client has disconnected");
        Update(*progress, fraction, std::nullopt);
        return absl::OkStatus();
      });
    }));
    compacting_ = false;  // before the client hears of the end, and may begin anew
    if (const std::shared_ptr<Progress> progress = client.lock()) Update(*progress, 1, end);
  }

  void Update(Progress& progress, double fraction, std::optional<absl::Status> end) {
    {
      std::lock_guard lock(progress.mutex);
      progress.fraction = fraction;
      progress.end = std::move(end);
    }
    changes_.Notify("");
  }

  absl::StatusOr<bool> Read(Progress& progress, v1::CompactResponse* response) {
    const StoreHealth health = store_.Health();
    response->set_size_bytes(health.size_bytes);
    response->set_unused_bytes(health.unused_bytes);
    std::lock_guard lock(progress.mutex);
    response->set_fraction(progress.fraction);
    if (progress.end && !progress.end->ok()) return *progress.end;
    return progress.end.has_value();
  }

  Store& store_;
  WatchHub& watches_;
  ChangeNotifier changes_{kMaxCompactStreams};
  std::atomic<bool> compacting_ = false;
  TaskQueue tasks_{"maintenance"};  // its task uses the members above
};

}  // namespace

std::unique_ptr<grpc::Service> MakeMaintenanceService(Store* store, WatchHub* watches) {
  return std::make_unique<MaintenanceService>(store, watches);
}

}  // namespace rigcal::server

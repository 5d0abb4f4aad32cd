// SPDX-License-Identifier: Apache-2.0
#include <atomic>

#include "common/status/status_macros.h"
#include "rigcal/v1/maintenance_service.grpc.pb.h"
#include "server/rpc/call_guard.h"
#include "server/rpc/services.h"

namespace rigcal::server {
namespace {

class MaintenanceService final : public v1::MaintenanceService::Service {
 public:
  explicit MaintenanceService(Store* store) : store_(*store) {}

  grpc::Status Compact(grpc::ServerContext*, const v1::CompactRequest*,
                       grpc::ServerWriter<v1::CompactResponse>* writer) override {
    return GuardedCall("Compact", [&]() -> absl::Status {
      if (compacting_.exchange(true)) {
        return absl::FailedPreconditionError(
            "the database is being compacted already; wait for the end of that");
      }
      const absl::Status status = store_.Compact([&](double fraction) {
        v1::CompactResponse response;
        const StoreHealth health = store_.Health();
        response.set_fraction(fraction);
        response.set_size_bytes(health.size_bytes);
        response.set_unused_bytes(health.unused_bytes);
        if (!writer->Write(response)) return absl::CancelledError("the client has disconnected");
        return absl::OkStatus();
      });
      compacting_ = false;
      return status;
    });
  }

 private:
  Store& store_;
  std::atomic<bool> compacting_ = false;
};

}  // namespace

std::unique_ptr<grpc::Service> MakeMaintenanceService(Store* store) {
  return std::make_unique<MaintenanceService>(store);
}

}  // namespace rigcal::server

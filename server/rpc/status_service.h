// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "rigcal/v1/status_service.grpc.pb.h"
#include "server/ingest/ingest.h"
#include "server/session/agent_directory.h"
#include "server/session/calibration_runner.h"
#include "server/session/session_coordinator.h"
#include "server/store/store.h"

namespace rigcal::server {

// rigcal.v1.StatusService.
class StatusService final : public v1::StatusService::Service {
 public:
  StatusService(const Store* store, const Ingest* ingest, const AgentDirectory* directory,
                const SessionCoordinator* coordinator, const CalibrationRunner* runner,
                size_t ingest_queue_limit_bytes, int64_t start_utc_ns)
      : store_(*store),
        ingest_(*ingest),
        directory_(*directory),
        coordinator_(*coordinator),
        runner_(*runner),
        ingest_queue_limit_bytes_(ingest_queue_limit_bytes),
        start_utc_ns_(start_utc_ns) {}

  grpc::Status GetStatus(grpc::ServerContext* context, const v1::GetStatusRequest* request,
                         v1::GetStatusResponse* response) override;

 private:
  const Store& store_;
  const Ingest& ingest_;
  const AgentDirectory& directory_;
  const SessionCoordinator& coordinator_;
  const CalibrationRunner& runner_;
  const size_t ingest_queue_limit_bytes_;
  const int64_t start_utc_ns_;
};

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/status_service.h"

#include <algorithm>
#include <string>

#include "common/wire/protocol_version.h"
#include "common/wire/time_wire.h"
#include "server/rpc/call_guard.h"

namespace rigcal::server {
namespace {

uint32_t Count(uint64_t count) {
  return static_cast<uint32_t>(std::min<uint64_t>(count, UINT32_MAX));
}

}  // namespace

grpc::Status StatusService::GetStatus(grpc::ServerContext* /*context*/,
                                      const v1::GetStatusRequest* /*request*/,
                                      v1::GetStatusResponse* response) {
  return GuardedCall("GetStatus", [&] {
    response->set_software_version(std::string(wire::kSoftwareVersion));
    *response->mutable_protocol_version() = wire::OwnProtocolVersion();
    response->set_server_id(store_.server_id());
    *response->mutable_start_time() = wire::ToTimestamp(start_utc_ns_);
    response->set_connected_agent_count(Count(directory_.ConnectedCount()));
    response->set_session_count(Count(coordinator_.SessionCount()));
    response->set_capturing_session_count(Count(coordinator_.CapturingCount()));
    response->set_queued_calibration_count(Count(runner_.QueuedCount()));

    const IngestStats stats = ingest_.Stats();
    v1::IngestStatus* ingest = response->mutable_ingest();
    ingest->set_stored_observation_count(stats.stored_observation_count);
    ingest->set_duplicate_observation_count(stats.duplicate_observation_count);
    ingest->set_refused_observation_count(stats.refused_observation_count);
    ingest->set_commit_count(stats.commit_count);
    ingest->set_queue_bytes(stats.queue_bytes);
    ingest->set_queue_limit_bytes(ingest_queue_limit_bytes_);
    ingest->set_problem(stats.problem);

    const StoreHealth health = store_.Health();
    v1::StoreStatus* store = response->mutable_store();
    store->set_kind(health.kind);
    store->set_schema_version(health.schema_version);
    store->set_size_bytes(health.size_bytes);
    store->set_free_bytes(health.free_bytes);
    return absl::OkStatus();
  });
}

}  // namespace rigcal::server

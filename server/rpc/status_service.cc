// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <chrono>
#include <optional>
#include <string>

#include "common/wire/protocol_version.h"
#include "common/wire/time_wire.h"
#include "rigcal/v1/status_service.grpc.pb.h"
#include "server/rpc/call_guard.h"
#include "server/rpc/services.h"

namespace rigcal::server {
namespace {

uint32_t Count(uint64_t count) {
  return static_cast<uint32_t>(std::min<uint64_t>(count, UINT32_MAX));
}

void FillRetention(const RetentionStats& stats, v1::RetentionStatus* retention) {
  if (stats.last_run_utc_ns != 0) {
    *retention->mutable_last_run_time() = wire::ToTimestamp(stats.last_run_utc_ns);
  }
  retention->set_session_count(stats.session_count);
  retention->set_last_session_id(stats.last_session_id);
  retention->set_kept_session_count(stats.kept_session_count);
  retention->set_problem(stats.problem);
}

void AddServer(const ServerEntry& server, v1::GetStatusResponse* response) {
  v1::ServerInfo* info = response->add_servers();
  info->set_host(server.host);
  info->set_address(server.address);
  info->set_page(server.page);
  info->set_software_version(server.version);
  *info->mutable_start_time() = wire::ToTimestamp(server.start_utc_ns);
  info->set_active(server.active);
  info->set_silent_ms(Count(static_cast<uint64_t>(std::max<int64_t>(server.last_seen_ms, 0))));
}

void FillWorker(const SolveWorker& worker, v1::SolveWorker* proto) {
  proto->set_host(worker.holder.host);
  proto->set_pid(worker.holder.pid);
  proto->set_software_version(worker.holder.software_version);
  proto->set_is_server(worker.holder.is_server);
  *proto->mutable_start_time() = wire::ToTimestamp(worker.start_utc_ns);
  *proto->mutable_heartbeat_time() = wire::ToTimestamp(worker.heartbeat_utc_ns);
  proto->set_is_alive(worker.is_alive);
  proto->mutable_calibration_ids()->Assign(worker.calibration_ids.begin(),
                                           worker.calibration_ids.end());
}

void FillStandby(const StandbyBook& standbys, v1::GetStatusResponse* response) {
  const std::optional<StandbyState> state = standbys.State();
  if (!state) return;
  v1::StandbyStatus* const standby = response->mutable_standby();
  standby->set_address(state->address);
  standby->set_connected(state->connected);
  *standby->mutable_last_time() = wire::ToTimestamp(state->last_utc_ns);
  standby->set_behind_count(state->behind_rows);
  standby->set_behind_s(state->behind_s);
}

class StatusService final : public v1::StatusService::Service {
 public:
  StatusService(const RpcServerParts& parts, size_t ingest_queue_limit_bytes, int64_t start_utc_ns,
                Listener* listener, size_t max_connections)
      : parts_(parts),
        ingest_queue_limit_bytes_(ingest_queue_limit_bytes),
        start_utc_ns_(start_utc_ns),
        listener_(*listener),
        max_connections_(max_connections) {}

  grpc::Status GetStatus(grpc::ServerContext*, const v1::GetStatusRequest*,
                         v1::GetStatusResponse* response) override {
    return GuardedCall("GetStatus", [&] {
      response->set_software_version(std::string(wire::kSoftwareVersion));
      *response->mutable_protocol_version() = wire::OwnProtocolVersion();
      response->set_server_id(parts_.store->server_id());
      *response->mutable_start_time() = wire::ToTimestamp(start_utc_ns_);
      response->set_connected_agent_count(Count(parts_.directory->ConnectedCount()));
      response->set_session_count(Count(parts_.coordinator->SessionCount()));
      response->set_capturing_session_count(Count(parts_.coordinator->CapturingCount()));
      response->set_queued_calibration_count(Count(parts_.runner->QueuedCount()));

      if (parts_.roster != nullptr) {
        for (ServerEntry server : parts_.roster->List()) {
          // The list is a second old. Who answers here has the turn.
          server.active = server.id == parts_.roster->own_id();
          AddServer(server, response);
        }
      }
      for (const SolveWorker& worker : parts_.runner->Workers()) {
        FillWorker(worker, response->add_workers());
      }

      const IngestStats stats = parts_.ingest->Stats();
      v1::IngestStatus* ingest = response->mutable_ingest();
      ingest->set_stored_observation_count(stats.stored_observation_count);
      ingest->set_duplicate_observation_count(stats.duplicate_observation_count);
      ingest->set_refused_observation_count(stats.refused_observation_count);
      ingest->set_commit_count(stats.commit_count);
      ingest->set_queue_bytes(stats.queue_bytes);
      ingest->set_queue_limit_bytes(ingest_queue_limit_bytes_);
      ingest->set_problem(stats.problem);
      ingest->set_conflict_observation_count(stats.conflict_observation_count);

      const StoreHealth health = parts_.store->Health();
      v1::StoreStatus* store = response->mutable_store();
      store->set_kind(health.kind);
      store->set_schema_version(health.schema_version);
      store->set_size_bytes(health.size_bytes);
      store->set_free_bytes(health.free_bytes);
      store->set_problem(health.problem.empty() ? health.read_problem : health.problem);
      store->set_unused_bytes(health.unused_bytes);
      store->set_reserve_bytes(health.reserve_bytes);
      if (parts_.retention != nullptr && parts_.retention->enabled()) {
        FillRetention(parts_.retention->Stats(), store->mutable_retention());
      }

      if (const ReplicaSource* const source = parts_.store->replica_source()) {
        response->set_generation(source->Generation().value_or(0));
      }
      if (parts_.standbys != nullptr) FillStandby(*parts_.standbys, response);

      const ConnectionStats open = listener_.connections().Stats();
      v1::ConnectionStatus* connections = response->mutable_connections();
      connections->set_open_count(open.open);
      connections->set_limit(Count(max_connections_));
      connections->set_accepted_count(open.accepted);
      connections->set_refused_count(open.refused);
      connections->set_deaf(listener_.IsDeaf());
      connections->set_flooding_count(open.flooding);
      for (const FloodRecord& flood : listener_.connections().Floods()) {
        v1::FloodRecord* record = connections->add_floods();
        *record->mutable_time() = wire::ToTimestamp(
            std::chrono::duration_cast<std::chrono::nanoseconds>(flood.time.time_since_epoch())
                .count());
        record->set_address(flood.address);
        record->set_peer(flood.peer);
        record->set_reason(flood.why);
      }
      return absl::OkStatus();
    });
  }

 private:
  const RpcServerParts parts_;
  const size_t ingest_queue_limit_bytes_;
  const int64_t start_utc_ns_;
  Listener& listener_;
  const size_t max_connections_;
};

}  // namespace

std::unique_ptr<grpc::Service> MakeStatusService(const RpcServerParts& parts,
                                                 size_t ingest_queue_limit_bytes,
                                                 int64_t start_utc_ns, Listener* listener,
                                                 size_t max_connections) {
  return std::make_unique<StatusService>(parts, ingest_queue_limit_bytes, start_utc_ns, listener,
                                         max_connections);
}

}  // namespace rigcal::server

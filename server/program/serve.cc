// SPDX-License-Identifier: Apache-2.0
#include "server/program/serve.h"

#include <pthread.h>
#include <signal.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "common/config/server_config.h"
#include "common/log/level_signals.h"
#include "common/service/service_notice.h"
#include "common/status/status_macros.h"
#include "common/text/printable.h"
#include "common/wire/protocol_version.h"
#include "server/audit/audit_log.h"
#include "server/care/running_server.h"
#include "server/estimate/estimate_loop.h"
#include "server/http/web_server.h"
#include "server/identity/server_identity.h"
#include "server/ingest/readiness.h"
#include "server/jobs/solve_in_worker.h"
#include "server/listen/port_file.h"
#include "server/live/live_tracker.h"
#include "server/metrics/metrics.h"
#include "server/monitor/rig_monitor.h"
#include "server/program/announcement.h"
#include "server/program/neighbours.h"
#include "server/program/own_addresses.h"
#include "server/program/part_options.h"
#include "server/replica/data_role.h"
#include "server/replica/standby_book.h"
#include "server/rpc/api_description.h"
#include "server/rpc/rpc_server.h"
#include "server/session/agent_registry.h"
#include "server/session/monitor_settings.h"
#include "server/standby/old_primary.h"
#include "server/store/data_directory.h"
#include "server/store/factory/open_store.h"
#include "server/store/server_roster.h"
#include "server/turn/wait_for_turn.h"

namespace rigcal::server {
namespace {

PortCounts GrpcCounts(RpcServer* rpc) {
  const ConnectionStats stats = rpc->connections();
  return {.open = stats.open, .accepted = stats.accepted, .refused = stats.refused};
}

WebCounts HttpCounts(const WebServer& web) {
  const HttpStats stats = web.Stats();
  return {.connections = {.open = stats.open_connections,
                          .accepted = stats.accepted_connections,
                          .refused = stats.dropped_connections},
          .requests = stats.requests,
          .refused_requests = stats.refused_requests};
}

// The folder of what is beside a database elsewhere: keys, who owns which camera, the audit log. In
// the other case the store opens it.
absl::StatusOr<std::unique_ptr<DataDirectory>> OpenFolderBeside(const ServerConfig& config) {
  if (config.store.empty()) return nullptr;
  if (!IsDatabaseAddress(config.store)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "--store ", config.store,
        " is no address of a database: write postgresql://USER@HOST/DATABASE, or name the folder "
        "of an embedded database with --data-dir"));
  }
  if (config.retention.max_size_mb > 0) {
    return absl::InvalidArgumentError(
        "retention.max_size_mb does not work with a database elsewhere, which does not tell how "
        "much of it is unused; use retention.max_age_days");
  }
  return DataDirectory::Open(config.data_dir);
}

// Another server has taken over: this one ends as on SIGTERM, and says so from then on.
void EndAsSuperseded(const std::filesystem::path& data_dir, uint64_t generation,
                     const std::string& by) {
  const DataRole role{
      .role = RoleOfData::kSuperseded, .generation = generation, .superseded_by = by};
  const absl::Status written = WriteDataRole(data_dir, role);
  spdlog::error("{}; nothing is accepted any more", WhyNotToServe(role));
  if (!written.ok()) {
    spdlog::error("after a restart it would serve again: {}", std::string(written.message()));
  }
  kill(getpid(), SIGTERM);
}

}  // namespace

sigset_t BlockSignals(bool has_config) {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  AddLevelSignals(has_config, &signals);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  signal(SIGPIPE, SIG_IGN);
  return signals;
}

absl::StatusOr<ServeEnd> Serve(ServerConfig& config, const ServerFlags& flags) {
  const sigset_t signals = BlockSignals(!flags.config_file.empty());
  const std::string& port_file = flags.port_file;
  const std::string& http_port_file = flags.http_port_file;
  // A file left by an earlier run must not be mistaken for this one's.
  if (!port_file.empty()) std::remove(port_file.c_str());
  if (!http_port_file.empty()) std::remove(http_port_file.c_str());
  const ServerLimits& limits = config.limits;
  RIGCAL_ASSIGN_OR_RETURN(const auto worker, FindWorker());
  RIGCAL_ASSIGN_OR_RETURN(const auto folder, OpenFolderBeside(config));
  const std::string& location = config.store.empty() ? config.data_dir : config.store;
  const std::filesystem::path data_dir = config.data_dir;
  AuditLog audit(data_dir / "audit.jsonl");
  RIGCAL_ASSIGN_OR_RETURN(const Neighbours neighbours, FindNeighbours(config));
  ServerRoster* const roster = neighbours.roster.get();
  WaitEnd turn;
  if (roster != nullptr) {
    RIGCAL_ASSIGN_OR_RETURN(
        turn, WaitForTurn(roster, neighbours.files.get(), signals,
                          [&](const Refusal& refusal) -> absl::StatusOr<WaitingPorts> {
                            RIGCAL_ASSIGN_OR_RETURN(
                                WaitingPorts ports,
                                OpenWaitingPorts(config, flags, roster, &audit, refusal));
                            // Any free port: the one that others know of by now.
                            config.listen = AddressOn(config.listen, ports.rpc_port);
                            return ports;
                          }));
    if (turn.signal > 0) return ServeEnd::kStopped;
  }
  RIGCAL_ASSIGN_OR_RETURN(
      const auto store,
      OpenStore(location, {.min_free_bytes = uint64_t{limits.disk_reserve_mb} << 20,
                           .unsafe = config.store_unsafe,
                           .server = roster == nullptr ? "" : roster->own_id(),
                           .silent_owner = turn.silent_owner}));
  // What another server has written until it lost its turn.
  if (roster != nullptr) RIGCAL_RETURN_IF_ERROR(neighbours.files->Fetch().status());
  if (!config.store.empty()) {
    spdlog::info("sessions and calibrations are in {}", PrintableLocation(location));
  }
  RIGCAL_ASSIGN_OR_RETURN(const std::filesystem::path identity, PrepareIdentity(config));
  RIGCAL_ASSIGN_OR_RETURN(const auto registry,
                          AgentRegistry::Open({.file = data_dir / "agents.json"}));
  RIGCAL_ASSIGN_OR_RETURN(const auto monitors, MonitorSettings::Open(data_dir / "monitors.json"));
  RIGCAL_ASSIGN_OR_RETURN(const DataRole role, ReadDataRole(data_dir));
  StandbyBook standbys(&store->changes());
  standbys.OnSuperseded([&](uint64_t generation, const std::string& by) {
    EndAsSuperseded(data_dir, generation, by);
  });
  AgentDirectory directory({.max_connected_agents = limits.max_agents,
                            .max_cameras_per_agent = limits.max_cameras_per_agent});
  RIGCAL_ASSIGN_OR_RETURN(
      const auto coordinator,
      SessionCoordinator::Create({.max_sessions = limits.max_sessions,
                                  .max_cameras_per_session = limits.max_cameras_per_session,
                                  .max_watches = limits.max_watches,
                                  .send_window = limits.send_window_rows},
                                 store.get(), &directory));
  const auto find_context = [&](const StreamKey& stream) {
    return coordinator->contexts().GetStreamContext(stream);
  };
  const auto report_progress = [&](const StreamKey& stream, const AppendOutcome& outcome) {
    coordinator->RecordProgress(stream, outcome);
  };
  const SilenceLimits silence = SilenceLimitsOf(limits);
  const auto estimate_silence = std::min(silence.end, EstimateWorkerOptions{}.silence_limit);
  LiveTracker live({}, store.get(), &directory, coordinator.get());
  EstimateLoop estimates({}, store.get(),
                         EstimateInWorker({.program = worker, .silence_limit = estimate_silence}),
                         [&live](LiveEstimate estimate) { live.SetEstimate(std::move(estimate)); });
  live.SetRowTap([&estimates](const StreamKey& stream, const ObservationBatch& batch) {
    estimates.AddRows(stream, batch);
  });
  live.SetEarlierTap([&estimates](const std::string& session_id, const SessionCamera& camera,
                                  const ObservationBatch& rows) {
    estimates.AddEarlierRows(session_id, camera, rows);
  });
  estimates.SetWaits([&live](const std::string& id) { return live.ReadsEarlier(id); });
  const auto report_delivery = [&](const Delivery& delivery, const AppendOutcome& outcome) {
    live.RecordDelivery(delivery, outcome);
  };
  Ingest ingest({.queue_limit_bytes = size_t{limits.ingest_queue_mb} << 20,
                 .send_window = limits.send_window_rows},
                store.get(), find_context, report_progress, report_delivery);
  SolveTimes solves;
  const SolveFunction solve =
      SolveInWorker({.program = worker,
                     .scratch_dir = config.data_dir,
                     .max_memory_bytes = uint64_t{limits.calibration_memory_mb} << 20,
                     .silence = silence});
  RIGCAL_ASSIGN_OR_RETURN(
      const auto runner,
      CalibrationRunner::Create({.max_queued = limits.max_queued_calibrations,
                                 .max_observations = limits.max_calibration_observations,
                                 .max_watches = limits.max_watches,
                                 .software_version = std::string(wire::kSoftwareVersion),
                                 .solve_here = config.solve.local},
                                store.get(), coordinator.get(), solves.Measured(solve)));
  RigMonitor monitor({.max_observations = limits.max_calibration_observations},
                     {.store = store.get(),
                      .coordinator = coordinator.get(),
                      .runner = runner.get(),
                      .settings = monitors.get(),
                      .audit = &audit,
                      .look = solve,
                      .show = [&live](const std::string& rig, LiveMonitor state) {
                        live.SetMonitor(rig, std::move(state));
                      }});
  WebServerOptions web_options = WebOptions(config);
  web_options.docs_dir = config.docs_dir;
  web_options.audit = &audit;
  web_options.ready = [&] { return Readiness(config.data_dir, store->Health(), ingest.Stats()); };
  RIGCAL_ASSIGN_OR_RETURN(const auto web, WebServer::Open(std::move(web_options)));
  if (web->authority() != nullptr) {
    web->authority()->SetNameHolder(
        [&](const std::string& agent_id) { return registry->HolderOf(agent_id); });
  }
  Retention retention(RetentionOf(config.retention), store.get(), coordinator.get());
  RpcServerOptions rpc_options = RpcOptions(config, identity);
  if (roster != nullptr) {
    rpc_options.agents.servers = [roster] {
      std::vector<std::string> addresses;
      for (const ServerEntry& server : roster->List()) addresses.push_back(server.address);
      return addresses;
    };
  }
  RpcServer rpc(std::move(rpc_options), {.store = store.get(),
                                         .ingest = &ingest,
                                         .directory = &directory,
                                         .coordinator = coordinator.get(),
                                         .runner = runner.get(),
                                         .registry = registry.get(),
                                         .audit = &audit,
                                         .identities = web->authority(),
                                         .retention = &retention,
                                         .live = &live,
                                         .monitors = monitors.get(),
                                         .roster = roster,
                                         .standbys = &standbys,
                                         .data_dir = data_dir});

  coordinator->Start();
  live.Start();
  estimates.Start();
  ingest.Start();
  runner->Start();
  monitor.Start();
  retention.Start();
  RIGCAL_ASSIGN_OR_RETURN(const int port, rpc.Start());
  // Where it serves when its turn comes again.
  config.listen = AddressOn(config.listen, port);
  const std::unique_ptr<ApiGateway> gateway = rpc.MakeApiGateway();
  // It uses what is gone after a failed start.
  const absl::Cleanup stop_web = [&] { web->Shutdown(); };
  const auto metrics = [&] {
    return MetricsText({.store = store.get(),
                        .ingest = &ingest,
                        .directory = &directory,
                        .coordinator = coordinator.get(),
                        .runner = runner.get(),
                        .solves = &solves,
                        .grpc = [&] { return GrpcCounts(&rpc); },
                        .web = [&] { return HttpCounts(*web); },
                        .software_version = std::string(wire::kSoftwareVersion)});
  };
  RIGCAL_RETURN_IF_ERROR(web->Start(
      port, {.gateway = gateway.get(), .api_description = ApiDescription(), .metrics = metrics}));
  if (!http_port_file.empty()) {
    RIGCAL_RETURN_IF_ERROR(WritePortFile(http_port_file, web->port()));
  }
  if (!port_file.empty()) RIGCAL_RETURN_IF_ERROR(WritePortFile(port_file, port));
  const RunningServerNote note(config.data_dir, AddressForCommands(config, port));
  spdlog::info("rigcal-server {} listens on {} (port {}{}), data in {}",
               std::string(wire::kSoftwareVersion), config.listen, port,
               identity.empty() ? "" : ", TLS", config.data_dir);
  spdlog::info("the dashboard is at {}", web->LocalUrl());
  if (IsNetworked(config)) TellWhoNeedsNoCertificate(config);
  if (web->authority() != nullptr) TellHowToJoin(*web);
  auto announcement = Announce(config, port, web.get());
  if (roster != nullptr) {
    RIGCAL_RETURN_IF_ERROR(neighbours.files->Publish());
    RIGCAL_RETURN_IF_ERROR(roster->Describe(OwnEntry(config, port, web.get())));
  }
  std::unique_ptr<OldPrimary> old_primary;
  if (role.role == RoleOfData::kPromoted) {
    old_primary = std::make_unique<OldPrimary>(role.primary, store->server_id(), role.generation,
                                               OwnName(config.listen));
  }

  TellReady(
      absl::StrCat("accepts calls at port ", port, ", the dashboard is at ", web->LocalUrl()));
  const auto read_level = [&flags]() -> absl::StatusOr<std::string> {
    RIGCAL_ASSIGN_OR_RETURN(const ServerConfig now, ReadServerConfig(flags.config_file));
    return now.log_level;
  };
  int received = 0;
  const auto prove_alive = [&] {
    store->Health();
    ingest.Stats();
  };
  std::function<bool()> is_replaced;
  if (roster != nullptr) is_replaced = [&store] { return store->Health().replaced; };
  do {
    received = WaitForSignal(signals, prove_alive, is_replaced);
  } while (received != 0 && TakeLevelSignal(received, read_level));
  const ServeEnd end = received == 0 ? ServeEnd::kReplaced : ServeEnd::kStopped;
  if (end == ServeEnd::kReplaced) {
    spdlog::warn("another server of {} writes now: this one waits for its turn again",
                 PrintableLocation(location));
  } else {
    TellStopping();
    spdlog::info("stopping on signal {}", received);
  }
  announcement.reset();
  if (roster != nullptr) neighbours.files->Stop();
  old_primary.reset();
  // In the order of the data flow: nothing more arrives, deliveries are written, then the rest.
  web->Shutdown();
  rpc.Shutdown(std::chrono::seconds(2));
  ingest.Shutdown();
  estimates.Shutdown();
  monitor.Shutdown();
  live.Shutdown();
  retention.Shutdown();
  runner->Shutdown();
  coordinator->Shutdown();
  spdlog::info("stopped");
  return end;
}

}  // namespace rigcal::server

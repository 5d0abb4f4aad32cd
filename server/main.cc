// SPDX-License-Identifier: Apache-2.0
#include <pthread.h>
#include <pwd.h>
#include <signal.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <array>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "common/command_line/command_line.h"
#include "common/config/server_config.h"
#include "common/discovery/discovery.h"
#include "common/failpoint/failpoint.h"
#include "common/identity/join_string.h"
#include "common/log/level_signals.h"
#include "common/log/start_log.h"
#include "common/service/service_notice.h"
#include "common/status/status_macros.h"
#include "common/text/printable.h"
#include "common/wire/protocol_version.h"
#include "server/audit/audit_log.h"
#include "server/care/care_commands.h"
#include "server/care/running_server.h"
#include "server/estimate/estimate_loop.h"
#include "server/http/web_server.h"
#include "server/identity/server_identity.h"
#include "server/ingest/readiness.h"
#include "server/jobs/solve_in_worker.h"
#include "server/listen/descriptor_limit.h"
#include "server/listen/listen_socket.h"
#include "server/listen/port_file.h"
#include "server/live/live_tracker.h"
#include "server/metrics/metrics.h"
#include "server/monitor/rig_monitor.h"
#include "server/replica/data_role.h"
#include "server/replica/standby_book.h"
#include "server/rpc/api_description.h"
#include "server/rpc/rpc_server.h"
#include "server/session/agent_registry.h"
#include "server/session/monitor_settings.h"
#include "server/session/utc_clock.h"
#include "server/standby/old_primary.h"
#include "server/standby/promote_command.h"
#include "server/standby/standby.h"
#include "server/store/factory/open_store.h"
#include "server/store/server_roster.h"
#include "server/store/data_directory.h"
#include "server/turn/wait_for_turn.h"

namespace rigcal::server {
namespace {

constexpr int kUsualPort = 7420;

struct Flags {
  std::string config_file;
  std::string port_file;
  std::string http_port_file;
  // These override the file.
  std::string listen;
  std::string advertise;
  std::string data_dir;
  std::string store;
  bool store_unsafe = false;
  bool no_solve = false;
  std::string docs_dir;
  std::string follow;
  std::string log_level;
  std::string log_format;
};

absl::StatusOr<ServerConfig> ReadConfig(const Flags& flags) {
  ServerConfig config;
  if (!flags.config_file.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(config, ReadServerConfig(flags.config_file));
  }
  if (!flags.listen.empty()) config.listen = WithPort(flags.listen, kUsualPort);
  if (!flags.log_level.empty()) config.log_level = flags.log_level;
  if (!flags.log_format.empty()) config.log_format = flags.log_format;
  if (!flags.data_dir.empty()) config.data_dir = flags.data_dir;
  if (!flags.advertise.empty()) config.advertise = WithPort(flags.advertise, kUsualPort);
  if (!flags.store.empty()) config.store = flags.store;
  if (flags.store_unsafe) config.store_unsafe = true;
  if (flags.no_solve) config.solve.local = false;
  if (!flags.docs_dir.empty()) config.docs_dir = flags.docs_dir;
  if (!flags.follow.empty()) config.follow = flags.follow;
  if (config.data_dir.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(config.data_dir, DefaultDataDirectory());
  }
  if (!config.follow.empty()) {
    config.follow = WithPort(config.follow, kUsualPort);
    const absl::Status address = ParseHostPort(config.follow).status();
    if (!address.ok()) {
      return absl::InvalidArgumentError(absl::StrCat("--follow: ", std::string(address.message())));
    }
    if (!config.store.empty()) {
      return absl::InvalidArgumentError(
          "--follow and --store do not go together: a standby has its database in its data folder; "
          "with PostgreSQL start the second server on the same database");
    }
  }
  return config;
}

// Blocks the signals in this thread and all that it starts, so that sigwait gets them.
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

// Other machines can reach one of the ports.
bool IsNetworked(const ServerConfig& config) {
  return !IsLoopbackAddress(config.listen) ||
         (!config.https.listen.empty() && !IsLoopbackAddress(config.https.listen));
}

// Clients on this machine need no certificate, whoever their user is.
bool HasOpenLoopback(const ServerConfig& config) {
  return !config.tls.loopback.value_or(IsNetworked(config));
}

// TLS is for whoever is on another machine; on this one it is there for clients that have joined.
absl::StatusOr<std::filesystem::path> PrepareIdentity(const ServerConfig& config) {
  std::error_code ignored;
  if (IsLoopbackAddress(config.listen) && HasOpenLoopback(config) && config.https.listen.empty() &&
      !std::filesystem::exists(IdentityDirectory(config.data_dir) / "server.crt", ignored)) {
    return std::filesystem::path();
  }
  RIGCAL_RETURN_IF_ERROR(EnsureServerIdentity(
      config.data_dir, CertificateHosts(config.advertise, config.listen, config.https.listen)));
  return IdentityDirectory(config.data_dir);
}

std::string UserName() {
  const passwd* const user = getpwuid(geteuid());
  return user == nullptr ? absl::StrCat(geteuid()) : user->pw_name;
}

std::filesystem::path SocketFile(const ServerConfig& config) {
  return std::filesystem::path(config.data_dir) / "rigcal.sock";
}

RpcServerOptions RpcOptions(const ServerConfig& config,
                            const std::filesystem::path& identity_folder) {
  const ServerLimits& limits = config.limits;
  const size_t connections = ConnectionsWithin(RaiseDescriptorLimit(), limits.max_connections);
  if (connections < limits.max_connections) {
    spdlog::warn(
        "at most {} connections, not {}: this process may not open more descriptors; "
        "raise its limit (ulimit -n)",
        connections, limits.max_connections);
  }
  return {.endpoint = {.listen_address = config.listen,
                       .socket_file = SocketFile(config),
                       .identity_folder = identity_folder,
                       .listener = {.plain_loopback = HasOpenLoopback(config),
                                    .limits = {.total = connections,
                                               .per_address = limits.max_connections_per_address}},
                       .memory_limit_bytes = size_t{limits.rpc_memory_mb} << 20},
          // More than agents, for streams that are being replaced.
          .agents = {.max_streams = size_t{limits.max_agents} + 64},
          .readers = {.max_readers = limits.max_readers},
          .ingest_queue_limit_bytes = size_t{limits.ingest_queue_mb} << 20};
}

// Once per start: what to type to use this server from elsewhere.
void TellHowToJoin(const WebServer& web) {
  spdlog::info(
      "other PCs join at the HTTPS port {}: `rigcal token create` on this PC prints a join string "
      "for `rigcal-agent join STRING` on a PC with cameras; `rigcal token create --role operator` "
      "one for `rigcal login STRING`",
      web.port());
}

void TellWhoNeedsNoCertificate(const ServerConfig& config) {
  if (HasOpenLoopback(config)) {
    spdlog::warn(
        "every user and program of this PC may do everything here without a certificate ([tls] "
        "loopback = false in the server's configuration)");
  } else {
    spdlog::info(
        "on this PC only user {} needs no certificate (over {}); to open 127.0.0.1 to every user "
        "of it, set [tls] loopback = false in the server's configuration",
        UserName(), SocketFile(config).string());
  }
}

// Names between commas, with spaces around them.
std::vector<std::string> HostsOf(const std::string& text) {
  std::vector<std::string> hosts;
  for (const absl::string_view host : absl::StrSplit(text, ',', absl::SkipWhitespace())) {
    hosts.emplace_back(absl::StripAsciiWhitespace(host));
  }
  return hosts;
}

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

// Null: it is not announced; the log says why where it should be. Nothing else depends on it.
std::unique_ptr<Discovery::Announcement> Announce(const ServerConfig& config, int grpc_port,
                                                  WebServer* web) {
  if (!config.discovery.mdns) return nullptr;
  const auto trouble = [](const std::string& why) {
    spdlog::warn("the server does not announce itself in its network: {}", why);
  };
  if (web->authority() == nullptr || IsLoopbackAddress(config.listen)) {
    trouble("other PCs cannot reach it; start it with --listen 0.0.0.0");
    return nullptr;
  }
  std::array<char, 256> host{};
  gethostname(host.data(), host.size() - 1);
  auto announcement = MakeDiscovery()->Announce({.name = host.data(),
                                                 .grpc_port = static_cast<uint16_t>(grpc_port),
                                                 .https_port = static_cast<uint16_t>(web->port())},
                                                trouble);
  if (!announcement.ok()) trouble(std::string(announcement.status().message()));
  return announcement.ok() ? *std::move(announcement) : nullptr;
}

RetentionOptions RetentionOf(const RetentionConfig& config) {
  return {.max_age = std::chrono::hours(24) * config.max_age_days,
          .max_bytes = uint64_t{config.max_size_mb} << 20,
          .delete_calibrated = config.delete_calibrated};
}

// With short limits it is said half way.
SilenceLimits SilenceLimitsOf(const ServerLimits& limits) {
  SilenceLimits silence;
  silence.end = std::chrono::seconds(limits.calibration_silence_s);
  silence.doubt = std::min(silence.doubt, silence.end / 2);
  return silence;
}

// How commands on this machine reach the server: by its socket file, which never needs a
// certificate, else by the port.
std::string AddressForCommands(const ServerConfig& config, int port) {
  std::error_code error;
  const std::filesystem::path file = std::filesystem::absolute(SocketFile(config), error);
  if (!error && std::filesystem::is_socket(file, error)) return "unix:" + file.string();
  return LocalAddress(config.listen, port);
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

int PortOf(const std::string& listen) {
  int port = 0;
  return absl::SimpleAtoi(listen.substr(listen.rfind(':') + 1), &port) ? port : 0;
}

// For messages of other servers: "pc-2:7420".
std::string OwnName(int port) {
  std::array<char, 256> host{};
  gethostname(host.data(), host.size() - 1);
  return absl::StrCat(host.data(), ":", port);
}

// HOST:PORT where others reach a port that listens on `listen`.
std::string AddressForOthers(const std::string& listen, int port) {
  std::string host;
  uint16_t listen_port = 0;
  if (!SplitHostPort(listen, &host, &listen_port)) return listen;
  const std::vector<std::string> hosts = ReachableHosts(host);
  return JoinHostPort(hosts.empty() ? host : hosts.front(),
                      port == 0 ? listen_port : static_cast<uint16_t>(port));
}

// `listen` with this port.
std::string AddressOn(const std::string& listen, int port) {
  std::string host;
  uint16_t ignored = 0;
  return SplitHostPort(listen, &host, &ignored) ? JoinHostPort(host, static_cast<uint16_t>(port))
                                                : listen;
}

// As the other servers of the store, and people, are told of this one. The ports may not be known
// yet.
ServerEntry OwnEntry(const ServerConfig& config, int port, const WebServer* web) {
  std::array<char, 256> host{};
  gethostname(host.data(), host.size() - 1);
  ServerEntry entry{.host = host.data(),
                    .address = config.advertise.empty() ? AddressForOthers(config.listen, port)
                                                        : config.advertise,
                    .version = std::string(wire::kSoftwareVersion),
                    .start_utc_ns = UtcNowNs({})};
  if (web != nullptr) {
    const bool plain = web->LocalUrl().starts_with("http://");
    entry.page = absl::StrCat(plain ? "http://" : "https://",
                              AddressForOthers(config.listen, web->port()), "/");
  }
  return entry;
}

// The servers of a database elsewhere, with this one, and the files that they share.
struct Neighbours {
  std::unique_ptr<ServerRoster> roster;  // null: this server has its store for itself
  std::unique_ptr<SharedFiles> files;
};

absl::StatusOr<Neighbours> FindNeighbours(const ServerConfig& config) {
  if (config.store.empty()) return Neighbours();
  Neighbours neighbours;
  RIGCAL_ASSIGN_OR_RETURN(neighbours.roster,
                          OpenServerRoster(config.store, {.unsafe = config.store_unsafe},
                                           OwnEntry(config, 0, nullptr)));
  neighbours.files = std::make_unique<SharedFiles>(config.data_dir, neighbours.roster.get());
  return neighbours;
}

// What a server that waits answers with at its ports.
absl::StatusOr<WaitingPorts> OpenWaitingPorts(const ServerConfig& config, const Flags& flags,
                                              ServerRoster* roster, AuditLog* audit,
                                              const Refusal& refusal) {
  RIGCAL_ASSIGN_OR_RETURN(const std::filesystem::path identity, PrepareIdentity(config));
  WaitingPorts ports;
  ports.rpc =
      std::make_unique<RefusingServer>(RpcOptions(config, identity).endpoint, audit, refusal);
  RIGCAL_ASSIGN_OR_RETURN(const int port, ports.rpc->Start());
  const auto notice = [roster] {
    WaitingNotice result{.message = "Another server of this database answers.", .active_page = ""};
    for (const ServerEntry& server : roster->List()) {
      if (server.active) result.active_page = server.page;
    }
    return result;
  };
  RIGCAL_ASSIGN_OR_RETURN(ports.web, WebServer::Open({.data_dir = config.data_dir,
                                                      .grpc_listen = config.listen,
                                                      .advertised = config.advertise,
                                                      .https_listen = config.https.listen,
                                                      .hosts = HostsOf(config.https.hosts),
                                                      .plain_loopback = HasOpenLoopback(config),
                                                      .waiting = notice}));
  RIGCAL_RETURN_IF_ERROR(ports.web->Start(port, {}));
  ports.rpc_port = port;
  if (!flags.http_port_file.empty()) {
    RIGCAL_RETURN_IF_ERROR(WritePortFile(flags.http_port_file, ports.web->port()));
  }
  if (!flags.port_file.empty()) RIGCAL_RETURN_IF_ERROR(WritePortFile(flags.port_file, port));
  RIGCAL_RETURN_IF_ERROR(roster->Describe(OwnEntry(config, port, ports.web.get())));
  return ports;
}

// How a run of the server has ended.
enum class End {
  kStopped,
  kReplaced,  // another server writes: this one may wait for its turn again
};

absl::StatusOr<End> Serve(ServerConfig& config, const Flags& flags) {
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
    if (turn.signal > 0) return End::kStopped;
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
  RIGCAL_ASSIGN_OR_RETURN(
      const auto web,
      WebServer::Open(
          {.data_dir = config.data_dir,
           .grpc_listen = config.listen,
           .advertised = config.advertise,
           .https_listen = config.https.listen,
           .hosts = HostsOf(config.https.hosts),
           .plain_loopback = HasOpenLoopback(config),
           .docs_dir = config.docs_dir,
           .audit = &audit,
           .ready = [&] { return Readiness(config.data_dir, store->Health(), ingest.Stats()); }}));
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
                                               OwnName(port));
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
  const End end = received == 0 ? End::kReplaced : End::kStopped;
  if (end == End::kReplaced) {
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

// Again and again where several servers of one database take turns.
absl::Status ServeInTurns(ServerConfig& config, const Flags& flags) {
  while (true) {
    const absl::StatusOr<End> end = Serve(config, flags);
    if (end.ok() && *end == End::kStopped) return absl::OkStatus();
    // Another one was the first to take over.
    const bool waits_again = end.ok() || (absl::IsAborted(end.status()) && !config.store.empty());
    if (!waits_again) return end.status();
  }
}

StandbyServerOptions StandbyPorts(const ServerConfig& config,
                                  const std::filesystem::path& identity) {
  return {.endpoint = RpcOptions(config, identity).endpoint};
}

// As what the data folder says that it is: a server, a standby, or one that was replaced.
absl::Status ServeInRole(ServerConfig config, const Flags& flags) {
  sigset_t wake;
  sigemptyset(&wake);
  sigaddset(&wake, SIGRTMIN);
  pthread_sigmask(SIG_BLOCK, &wake, nullptr);
  BlockSignals(!flags.config_file.empty());
  while (true) {
    RIGCAL_ASSIGN_OR_RETURN(const DataRole role, ReadDataRole(config.data_dir));
    if (role.role == RoleOfData::kPromoted && !config.follow.empty()) {
      spdlog::warn(
          "this server has taken over from {} and serves; --follow {} has no effect any "
          "more, remove it",
          role.primary, config.follow);
    } else if (!config.follow.empty()) {
      RIGCAL_ASSIGN_OR_RETURN(const std::filesystem::path identity, PrepareIdentity(config));
      RIGCAL_ASSIGN_OR_RETURN(
          const StandbyEnd end,
          RunStandby({.primary = config.follow,
                      .data_dir = config.data_dir,
                      .store = {.min_free_bytes = uint64_t{config.limits.disk_reserve_mb} << 20},
                      .server = StandbyPorts(config, identity),
                      .port_file = flags.port_file,
                      .own_name = OwnName(PortOf(config.listen))}));
      if (end == StandbyEnd::kStopped) return absl::OkStatus();
      continue;
    }
    if (role.role == RoleOfData::kStandby) {
      return absl::FailedPreconditionError(absl::StrCat(
          config.data_dir, " is the data folder of a standby of ", role.primary,
          ": start it with --follow ", role.primary, ", or make it take over: rigcal-server ",
          "promote --data-dir ", config.data_dir));
    }
    if (role.role == RoleOfData::kSuperseded) {
      RIGCAL_ASSIGN_OR_RETURN(const std::filesystem::path identity, PrepareIdentity(config));
      StandbyServerOptions options = StandbyPorts(config, identity);
      options.active_server = role.superseded_by;
      options.reason = WhyNotToServe(role);
      return RunRefusing(std::move(options), config.data_dir, flags.port_file);
    }
    RIGCAL_RETURN_IF_ERROR(ServeInTurns(config, flags));
    RIGCAL_ASSIGN_OR_RETURN(const DataRole now, ReadDataRole(config.data_dir));
    if (now.role != RoleOfData::kSuperseded) return absl::OkStatus();
  }
}

// On stderr whatever the log level.
int Refuse(const absl::Status& status, int exit_code) {
  std::fprintf(stderr, "rigcal-server: %s\n",
               PrintableLines(std::string(status.message())).c_str());
  return exit_code;
}

int Run(int argc, char** argv) {
  Flags flags;
  CLI::App app(
      "Receives observations from capture agents, stores them, and calibrates the rig.\n"
      "Listens on this machine only; on other addresses with TLS, for clients that have joined.",
      "rigcal-server");
  app.add_option("--config", flags.config_file, "TOML file; flags override it")->type_name("FILE");
  app.add_option(
         "--listen", flags.listen,
         "Address for agents and the command line (default 127.0.0.1:7420; port 0: any free "
         "one); the dashboard and the JSON API are at the port behind it, unless the "
         "configuration names one under [https]")
      ->type_name("HOST[:PORT]");
  app.add_option(
         "--advertise", flags.advertise,
         "Address that others are told, where it is not that of this PC: of a container, or "
         "behind a router; it gets into the certificate and into join strings")
      ->type_name("HOST[:PORT]");
  app.add_option("--data-dir", flags.data_dir,
                 "Folder of the database (default $XDG_DATA_HOME/rigcal or ~/.local/share/rigcal)")
      ->type_name("DIR");
  app.add_option(
         "--store", flags.store,
         "Database elsewhere, instead of the one in the data folder; the password comes from "
         "~/.pgpass or PGPASSWORD")
      ->type_name("postgresql://USER@HOST/DATABASE");
  app.add_flag("--store-unsafe", flags.store_unsafe,
               "Also take a PostgreSQL server that can lose data when its power fails (fsync off)");
  app.add_flag("--no-solve", flags.no_solve,
               "Leave calibrations to rigcal-workers on the database (with --store)");
  app.add_option(
         "--docs-dir", flags.docs_dir,
         "Folder of the documentation, shown at /docs/ beside the dashboard (default: where "
         "the package rigcal-doc has it)")
      ->type_name("DIR");
  app.add_option("--follow", flags.follow,
                 "Be a standby of the server there: copy its data, and take over when asked to "
                 "(promote)")
      ->type_name("HOST:PORT");
  app.add_option("--port-file", flags.port_file,
                 "File for the port number, written once the server accepts calls")
      ->type_name("FILE");
  app.add_option("--http-port-file", flags.http_port_file,
                 "The same for the port of the dashboard and the JSON API")
      ->type_name("FILE");
  app.add_option("--log-level", flags.log_level, "Lowest level logged on stderr (default info)")
      ->check(CLI::IsMember({"trace", "debug", "info", "warn", "error", "off"}));
  app.add_option("--log-format", flags.log_format,
                 "text, json (a JSON object per line), journal (entries with fields in systemd's "
                 "journal), or auto: journal under systemd, else text (default auto)")
      ->check(CLI::IsMember({"auto", "text", "json", "journal"}));
  CareCommands care(&app);
  const PromoteCommand promote(&app);
  AddVersionFlags(app, std::string(wire::kSoftwareVersion));
  const auto task = ParseCommandLine(app, argc, argv, std::cout);
  if (!task.ok()) return Refuse(task.status(), kUsageExitCode);
  if (*task == CommandLineTask::kDone) return 0;

  StartLog("rigcal-server");
  absl::Status status = ActivateFailpoints();
  for (const auto& [option, given] :
       {std::pair{"--listen", &flags.listen}, std::pair{"--advertise", &flags.advertise}}) {
    if (given->empty()) continue;
    const absl::Status address = ParseHostPort(WithPort(*given, kUsualPort)).status();
    if (!address.ok()) {
      return Refuse(
          absl::InvalidArgumentError(absl::StrCat(option, ": ", std::string(address.message()))),
          kUsageExitCode);
    }
  }
  const absl::StatusOr<ServerConfig> config = ReadConfig(flags);
  if (!status.ok()) {
    // Said below.
  } else if (!config.ok()) {
    status = config.status();
  } else {
    status = SetLogLevel(config->log_level);
    if (status.ok() && care.chosen()) return care.Run(config->data_dir, config->store);
    if (status.ok() && promote.chosen()) return promote.Run(config->data_dir);
    if (status.ok()) status = SetLogFormat(config->log_format);
    if (status.ok()) status = ServeInRole(*config, flags);
  }
  return status.ok() ? 0 : Refuse(status, 1);
}

}  // namespace
}  // namespace rigcal::server

int main(int argc, char** argv) {
  try {
    return rigcal::server::Run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "rigcal-server: unexpected error: %s\n", error.what());
    return 1;
  }
}

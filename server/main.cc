// SPDX-License-Identifier: Apache-2.0
#include <pthread.h>
#include <signal.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <string>

#include "common/config/server_config.h"
#include "common/status/status_macros.h"
#include "common/wire/protocol_version.h"
#include "server/rpc/rpc_server.h"
#include "server/solve/calibrate.h"
#include "server/store/factory/open_store.h"

namespace rigcal::server {
namespace {

struct Flags {
  std::string config_file;
  std::string port_file;
  // These override the file.
  std::string listen;
  std::string data_dir;
  std::string log_level;
};

absl::StatusOr<ServerConfig> ReadConfig(const Flags& flags) {
  ServerConfig config;
  if (!flags.config_file.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(config, ReadServerConfig(flags.config_file));
  }
  if (!flags.listen.empty()) config.listen = flags.listen;
  if (!flags.log_level.empty()) config.log_level = flags.log_level;
  if (!flags.data_dir.empty()) config.data_dir = flags.data_dir;
  if (config.data_dir.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(config.data_dir, DefaultDataDirectory());
  }
  return config;
}

// Atomic: a reader finds the whole number or no file.
absl::Status WritePortFile(const std::string& path, int port) {
  const std::string temporary = path + ".new";
  std::ofstream file(temporary, std::ios::trunc);
  file << port << "\n";
  file.close();
  if (!file || std::rename(temporary.c_str(), path.c_str()) != 0) {
    return absl::UnavailableError("cannot write the port file " + path);
  }
  return absl::OkStatus();
}

// Blocks the signals in this thread and all that it starts, so that sigwait gets them.
sigset_t BlockStopSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  signal(SIGPIPE, SIG_IGN);
  return signals;
}

RpcServerOptions RpcOptions(const ServerConfig& config) {
  const ServerLimits& limits = config.limits;
  return {.listen_address = config.listen,
          // More than agents, for streams that have not sent their hello or are being replaced.
          .agents = {.max_streams = size_t{limits.max_agents} + 64},
          .memory_limit_bytes = size_t{limits.rpc_memory_mb} << 20,
          // Every watch holds a thread; the rest is for calls that are answered at once.
          .max_threads = static_cast<int>(2 * limits.max_watches) + 64,
          .ingest_queue_limit_bytes = size_t{limits.ingest_queue_mb} << 20};
}

absl::Status Serve(const ServerConfig& config, const std::string& port_file) {
  const sigset_t stop_signals = BlockStopSignals();
  // A file left by an earlier run must not be mistaken for this one's.
  if (!port_file.empty()) std::remove(port_file.c_str());
  const ServerLimits& limits = config.limits;
  RIGCAL_RETURN_IF_ERROR(CheckLoopback(config.listen));
  RIGCAL_ASSIGN_OR_RETURN(const auto store, OpenStore(config.data_dir));
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
  Ingest ingest({.queue_limit_bytes = size_t{limits.ingest_queue_mb} << 20,
                 .send_window = limits.send_window_rows},
                store.get(), find_context, report_progress);
  RIGCAL_ASSIGN_OR_RETURN(
      const auto runner,
      CalibrationRunner::Create({.max_queued = limits.max_queued_calibrations,
                                 .max_observations = limits.max_calibration_observations,
                                 .max_watches = limits.max_watches,
                                 .software_version = std::string(wire::kSoftwareVersion)},
                                store.get(), coordinator.get(), Calibrate));
  RpcServer rpc(RpcOptions(config), {.store = store.get(),
                                     .ingest = &ingest,
                                     .directory = &directory,
                                     .coordinator = coordinator.get(),
                                     .runner = runner.get()});

  coordinator->Start();
  ingest.Start();
  runner->Start();
  RIGCAL_ASSIGN_OR_RETURN(const int port, rpc.Start());
  if (!port_file.empty()) RIGCAL_RETURN_IF_ERROR(WritePortFile(port_file, port));
  spdlog::info("rigcal-server {} listens on {} (port {}), data in {}",
               std::string(wire::kSoftwareVersion), config.listen, port, config.data_dir);

  int received = 0;
  sigwait(&stop_signals, &received);
  spdlog::info("stopping on signal {}", received);
  // In the order of the data flow: nothing more arrives, deliveries are written, then the rest.
  rpc.Shutdown(std::chrono::seconds(2));
  ingest.Shutdown();
  runner->Shutdown();
  coordinator->Shutdown();
  spdlog::info("stopped");
  return absl::OkStatus();
}

int Run(int argc, char** argv) {
  Flags flags;
  CLI::App app(
      "Receives observations from capture agents, stores them, and calibrates the rig.\n"
      "Listens on this machine only.");
  app.set_version_flag("--version", std::string(wire::kSoftwareVersion));
  app.add_option("--config", flags.config_file, "TOML file; flags override it")->type_name("FILE");
  app.add_option("--listen", flags.listen,
                 "Address to listen on (default 127.0.0.1:7420; port 0: any free one)")
      ->type_name("HOST:PORT");
  app.add_option("--data-dir", flags.data_dir,
                 "Folder of the database (default $XDG_DATA_HOME/rigcal or ~/.local/share/rigcal)")
      ->type_name("DIR");
  app.add_option("--port-file", flags.port_file,
                 "File for the port number, written once the server accepts calls")
      ->type_name("FILE");
  app.add_option("--log-level", flags.log_level, "Lowest level logged on stderr (default info)")
      ->check(CLI::IsMember({"trace", "debug", "info", "warn", "error", "off"}));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }

  spdlog::set_default_logger(spdlog::stderr_color_mt("rigcal-server"));
  absl::Status status;
  const absl::StatusOr<ServerConfig> config = ReadConfig(flags);
  if (!config.ok()) {
    status = config.status();
  } else {
    spdlog::set_level(
        spdlog::level::from_str(config->log_level == "warn" ? "warning" : config->log_level));
    status = Serve(*config, flags.port_file);
  }
  if (status.ok()) return 0;
  // On stderr whatever the log level.
  std::fprintf(stderr, "rigcal-server: %s\n", std::string(status.message()).c_str());
  return 1;
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

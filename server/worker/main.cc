// SPDX-License-Identifier: Apache-2.0
#include <signal.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <iostream>
#include <new>
#include <string>

#include "common/command_line/command_line.h"
#include "common/log/correlation_id.h"
#include "common/log/log_fields.h"
#include "common/log/start_log.h"
#include "common/wire/protocol_version.h"
#include "server/worker/worker.h"
#include "server/worker/worker_limits.h"

namespace rigcal::server {
namespace {

[[noreturn]] void EndOutOfMemory() { _exit(kWorkerOutOfMemory); }

int RunProgram(int argc, char** argv) {
  pid_t parent = 0;
  uint64_t memory_bytes = 0;
  bool estimate = false;
  std::string log_format = "auto";
  std::string log_level = "info";
  CLI::App app(
      "Runs one solve for rigcal-server, which starts it: reads the observations from standard\n"
      "input and writes progress and result to standard output.",
      "rigcal-worker");
  app.add_option("--parent", parent, "Process to end with")->type_name("PID");
  app.add_option("--memory", memory_bytes, "Limit of the solve's memory; 0: none")
      ->type_name("BYTES");
  app.add_flag("--estimate", estimate, "Make a running estimate instead of a calibration");
  app.add_option("--log-format", log_format, "As for rigcal-server");
  app.add_option("--log-level", log_level, "As for rigcal-server");
  AddVersionFlags(app, std::string(wire::kSoftwareVersion));
  const auto task = ParseCommandLine(app, argc, argv, std::cout);
  if (!task.ok()) {
    std::fprintf(stderr, "rigcal-worker: %s\n", std::string(task.status().message()).c_str());
    return kUsageExitCode;
  }
  if (*task == CommandLineTask::kDone) return 0;
  signal(SIGPIPE, SIG_IGN);
  StartLog("rigcal-worker");
  const LogScope scope({.correlation = OwnCorrelationId()});
  absl::Status status = SetLogFormat(log_format);
  if (status.ok()) status = SetLogLevel(log_level);
  if (status.ok()) status = ApplyWorkerLimits(parent, memory_bytes);
  std::set_new_handler(EndOutOfMemory);
  if (status.ok()) {
    spdlog::log(estimate ? spdlog::level::debug : spdlog::level::info,
                "process {} solves for process {}", getpid(), parent);
    status = estimate ? RunEstimateWorker(STDIN_FILENO, STDOUT_FILENO)
                      : RunWorker(STDIN_FILENO, STDOUT_FILENO);
  }
  if (status.ok()) return 0;
  if (absl::IsResourceExhausted(status)) return kWorkerOutOfMemory;
  spdlog::error("{}", std::string(status.message()));
  return 1;
}

}  // namespace
}  // namespace rigcal::server

int main(int argc, char** argv) {
  try {
    return rigcal::server::RunProgram(argc, argv);
  } catch (const std::bad_alloc&) {
    return rigcal::server::kWorkerOutOfMemory;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "rigcal-worker: unexpected error: %s\n", error.what());
    return 1;
  }
}

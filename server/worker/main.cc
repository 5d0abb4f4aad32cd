// SPDX-License-Identifier: Apache-2.0
#include <pthread.h>
#include <signal.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <iostream>
#include <new>
#include <string>

#include "absl/strings/str_cat.h"
#include "common/command_line/command_line.h"
#include "common/failpoint/failpoint.h"
#include "common/log/correlation_id.h"
#include "common/log/log_fields.h"
#include "common/log/start_log.h"
#include "common/service/service_notice.h"
#include "common/status/status_macros.h"
#include "common/text/printable.h"
#include "common/wire/protocol_version.h"
#include "server/jobs/queue_worker.h"
#include "server/jobs/solve_in_worker.h"
#include "server/store/factory/open_store.h"
#include "server/worker/worker.h"
#include "server/worker/worker_limits.h"

namespace rigcal::server {
namespace {

constexpr int kMaxJobs = 64;

// What takes calibrations from the queue of a server elsewhere.
struct QueueFlags {
  std::string store;  // empty: a server has started it for one solve
  std::string scratch_dir;
  int jobs = 1;
  uint32_t max_memory_mb = 12'288;  // as limits.calibration_memory_mb of a server
};

// Blocks the signals in this thread and all that it starts, so that sigwait gets them.
sigset_t BlockSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  return signals;
}

absl::Status TakeCalibrations(const QueueFlags& flags) {
  const sigset_t signals = BlockSignals();
  RIGCAL_ASSIGN_OR_RETURN(const auto program, FindWorker());
  RIGCAL_ASSIGN_OR_RETURN(const auto store, OpenJobStore(flags.store));
  std::error_code error;
  const std::filesystem::path scratch = flags.scratch_dir.empty()
                                            ? std::filesystem::temp_directory_path(error)
                                            : std::filesystem::path(flags.scratch_dir);
  const JobHolder holder = ThisHolder(std::string(wire::kSoftwareVersion), false);
  QueueWorker worker({.solver = {.holder = holder}, .jobs = flags.jobs}, store.get(),
                     SolveInWorker({.program = program,
                                    .scratch_dir = scratch,
                                    .max_memory_bytes = uint64_t{flags.max_memory_mb} << 20}));
  worker.Start();
  const std::string place = PrintableLocation(flags.store);
  spdlog::info("rigcal-worker {} on {} (process {}) takes calibrations from {}, {} at a time",
               holder.software_version, holder.host, holder.pid, place, flags.jobs);
  TellReady(absl::StrCat("takes calibrations from ", place));
  const int received = WaitForSignal(signals, [&] { store->Health(); });
  TellStopping();
  spdlog::info("stopping on signal {}", received);
  worker.Shutdown();
  spdlog::info("stopped");
  return absl::OkStatus();
}

[[noreturn]] void EndOutOfMemory() { _exit(kWorkerOutOfMemory); }

int RunProgram(int argc, char** argv) {
  pid_t parent = 0;
  uint64_t memory_bytes = 0;
  bool estimate = false;
  std::string log_format = "auto";
  std::string log_level = "info";
  CLI::App app(
      "Solves calibrations. With --store it takes them from the queue of a rigcal-server whose\n"
      "database it reaches, on any PC, and ends on SIGTERM. Without, rigcal-server or a worker "
      "has\n"
      "started it for one solve: it reads the observations from standard input and writes "
      "progress\n"
      "and result to standard output.",
      "rigcal-worker");
  app.add_option("--parent", parent, "Process to end with")->type_name("PID");
  app.add_option("--memory", memory_bytes, "Limit of the solve's memory; 0: none")
      ->type_name("BYTES");
  app.add_flag("--estimate", estimate, "Make a running estimate instead of a calibration");
  QueueFlags queue;
  app.add_option("--store", queue.store,
                 "Database of the server; the password comes from ~/.pgpass or PGPASSWORD")
      ->type_name("postgresql://USER@HOST/DATABASE")
      ->excludes("--parent")
      ->excludes("--memory")
      ->excludes("--estimate");
  app.add_option("--jobs", queue.jobs, "With --store: calibrations at a time (default 1)")
      ->check(CLI::Range(1, kMaxJobs))
      ->needs("--store");
  app.add_option("--max-memory-mb", queue.max_memory_mb,
                 "With --store: MiB that one calibration may use (default 12288)")
      ->check(CLI::Range(64, 4'000'000))
      ->needs("--store");
  app.add_option("--scratch-dir", queue.scratch_dir,
                 "With --store: folder for the observations of a solve (default $TMPDIR or /tmp)")
      ->type_name("DIR")
      ->needs("--store");
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
  if (!queue.store.empty()) {
    if (status.ok()) status = ActivateFailpoints();
    if (status.ok()) status = TakeCalibrations(queue);
    if (status.ok()) return 0;
    std::fprintf(stderr, "rigcal-worker: %s\n",
                 PrintableLines(std::string(status.message())).c_str());
    return 1;
  }
  if (status.ok()) status = ApplyWorkerLimits(parent, memory_bytes);
  std::set_new_handler(EndOutOfMemory);
  if (status.ok()) {
    spdlog::log(estimate ? spdlog::level::debug : spdlog::level::info,
                "process {} solves for process {}", getpid(), parent);
    status = estimate ? RunEstimateWorker(STDIN_FILENO, STDOUT_FILENO)
                      : RunWorker(STDIN_FILENO, STDOUT_FILENO);
  }
  if (status.ok()) return 0;
  if (parent == 0) {
    status = absl::Status(status.code(),
                          absl::StrCat(std::string(status.message()),
                                       ". To take calibrations from the database of a server: "
                                       "rigcal-worker --store postgresql://USER@HOST/DATABASE"));
  }
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

// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/estimate_in_worker.h"

#include <signal.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/log/start_log.h"
#include "common/status/status_macros.h"
#include "server/jobs/signs_of_life.h"
#include "server/jobs/worker_process.h"
#include "server/worker/estimate_messages.h"
#include "server/worker/worker.h"

namespace rigcal::server {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr size_t kEstimatePipeBytes = size_t{1} << 16;
constexpr std::chrono::milliseconds kEstimateLookInterval{20};

// A file in memory: the rows of an estimate are few.
class MemoryFile {
 public:
  static absl::StatusOr<MemoryFile> Create() {
    const int file = memfd_create("rigcal-estimate", MFD_CLOEXEC);
    if (file >= 0) return MemoryFile(file);
    return absl::ResourceExhaustedError(
        absl::StrCat("no memory for the rows of an estimate: ", strerror(errno)));
  }
  MemoryFile(MemoryFile&& other) noexcept : file_(std::exchange(other.file_, -1)) {}
  MemoryFile& operator=(MemoryFile&&) = delete;
  ~MemoryFile() {
    if (file_ >= 0) close(file_);
  }
  int descriptor() const { return file_; }

 private:
  explicit MemoryFile(int file) : file_(file) {}
  int file_;
};

absl::StatusOr<MemoryFile> WriteRows(const EstimateTask& task) {
  RIGCAL_ASSIGN_OR_RETURN(MemoryFile file, MemoryFile::Create());
  EstimateInputWriter writer(file.descriptor());
  RIGCAL_RETURN_IF_ERROR(writer.Begin(task.target, task.tracks, task.data_share, task.start));
  for (size_t t = 0; t < task.rows.size(); ++t) {
    for (const ObservationBatch& batch : task.rows[t]) {
      RIGCAL_RETURN_IF_ERROR(writer.AddRows(t, batch));
    }
  }
  RIGCAL_RETURN_IF_ERROR(writer.End());
  if (lseek(file.descriptor(), 0, SEEK_SET) != 0) {
    return absl::UnavailableError(absl::StrCat("the rows of an estimate: ", strerror(errno)));
  }
  return file;
}

// What the worker has to say in the end; unset: it ended without it.
absl::StatusOr<std::optional<worker::v1::EstimateOutput>> ReadOutcome(
    WorkerProcess& process, const EstimateWorkerOptions& options,
    const std::atomic<bool>& cancelled) {
  SignsOfLife life(
      {.doubt = options.silence_limit, .end = options.silence_limit, .stuck = options.time_limit},
      SteadyClock::now());
  MessageCutter cutter;
  std::optional<worker::v1::EstimateOutput> outcome;
  while (true) {
    bool ended = false;
    RIGCAL_ASSIGN_OR_RETURN(const std::string bytes,
                            process.Read(kEstimatePipeBytes, kEstimateLookInterval, &ended));
    cutter.Add(bytes.data(), bytes.size());
    while (true) {
      worker::v1::EstimateOutput message;
      RIGCAL_ASSIGN_OR_RETURN(const bool complete, cutter.Next(&message));
      if (!complete) break;
      life.Hear(false);
      if (!message.has_heartbeat()) outcome = std::move(message);
    }
    if (ended) return outcome;
    if (cancelled) return absl::CancelledError("the estimate was cancelled");
    switch (life.Look(SteadyClock::now())) {
      case SignsOfLife::State::kSilent:
        return absl::DeadlineExceededError(
            absl::StrCat("the running estimate was ended: rigcal-worker (process ", process.pid(),
                         ") gave no sign of life for ", options.silence_limit.count() / 1000,
                         " s: it was stopped, or waited for something that did not come"));
      case SignsOfLife::State::kStuck:
        return absl::DeadlineExceededError(absl::StrCat("the running estimate took more than ",
                                                        options.time_limit.count() / 1000, " s"));
      default:
        break;
    }
  }
}

absl::Status DescribeEnd(int ended) {
  if (WIFEXITED(ended) && WEXITSTATUS(ended) == kWorkerOutOfMemory) {
    return absl::ResourceExhaustedError("rigcal-worker ran out of its memory");
  }
  if (WIFSIGNALED(ended) && WTERMSIG(ended) == SIGKILL) {
    return absl::UnavailableError("rigcal-worker was killed (signal 9)");
  }
  if (WIFSIGNALED(ended)) {
    return absl::InternalError(absl::StrCat("rigcal-worker crashed (signal ", WTERMSIG(ended), ", ",
                                            strsignal(WTERMSIG(ended)), ")"));
  }
  return absl::InternalError(absl::StrCat("rigcal-worker ended without a result (code ",
                                          WEXITSTATUS(ended),
                                          "); the reason is in the server's log"));
}

}  // namespace

EstimateFunction EstimateInProcess() {
  return [](EstimateTask task, const std::atomic<bool>& cancelled) {
    RunningInput input;
    input.target = std::move(task.target);
    input.tracks = std::move(task.tracks);
    for (size_t t = 0; t < task.rows.size(); ++t) {
      for (const ObservationBatch& batch : task.rows[t]) AddRows(batch, &input.tracks[t]);
    }
    input.data_share = task.data_share;
    input.start = std::move(task.start);
    input.cancelled = &cancelled;
    return absl::StatusOr<RunningOutcome>(EstimateNow(std::move(input)));
  };
}

EstimateFunction EstimateInWorker(EstimateWorkerOptions options) {
  return
      [options = std::move(options)](
          EstimateTask task, const std::atomic<bool>& cancelled) -> absl::StatusOr<RunningOutcome> {
        RIGCAL_ASSIGN_OR_RETURN(const MemoryFile input, WriteRows(task));
        RIGCAL_ASSIGN_OR_RETURN(
            WorkerProcess process,
            WorkerProcess::Start(options.program,
                                 {"--estimate", absl::StrCat("--parent=", getpid()),
                                  absl::StrCat("--memory=", options.memory_bytes),
                                  "--log-format=" + LogFormat(), "--log-level=" + LogLevel()},
                                 input.descriptor()));
        const auto outcome = ReadOutcome(process, options, cancelled);
        if (!outcome.ok()) process.Kill();
        const int ended = process.Wait();
        RIGCAL_RETURN_IF_ERROR(outcome.status());
        if (!*outcome) return DescribeEnd(ended);
        return FromProto(**outcome);
      };
}

}  // namespace rigcal::server

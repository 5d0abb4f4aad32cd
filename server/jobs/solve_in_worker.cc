// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/solve_in_worker.h"

#include <fcntl.h>
#include <signal.h>
#include <spdlog/spdlog.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <numeric>
#include <optional>
#include <string>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/log/start_log.h"
#include "common/status/status_macros.h"
#include "common/wire/calibration_wire.h"
#include "server/jobs/worker_process.h"
#include "server/session/calibration_input.h"
#include "server/session/incomplete_session.h"
#include "server/worker/solve_input.h"
#include "server/worker/worker.h"
#include "server/worker/worker_limits.h"

namespace rigcal::server {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr size_t kPipeBytes = size_t{1} << 16;
constexpr std::chrono::milliseconds kLookInterval{50};

// A file without a name.
class ScratchFile {
 public:
  static absl::StatusOr<ScratchFile> Create(const std::filesystem::path& folder) {
    int file = open(folder.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
    if (file < 0) {
      // Not every file system has O_TMPFILE.
      std::string name = (folder / "solve-XXXXXX").string();
      file = mkostemp(name.data(), O_CLOEXEC);
      if (file >= 0) unlink(name.c_str());
    }
    if (file >= 0) return ScratchFile(file);
    const std::string why =
        absl::StrCat("cannot create a file in ", folder.string(), ": ", strerror(errno));
    return errno == ENOSPC ? absl::ResourceExhaustedError(why) : absl::UnavailableError(why);
  }
  ScratchFile(ScratchFile&& other) noexcept : file_(std::exchange(other.file_, -1)) {}
  ScratchFile& operator=(ScratchFile&&) = delete;
  ~ScratchFile() {
    if (file_ >= 0) close(file_);
  }
  int descriptor() const { return file_; }

 private:
  explicit ScratchFile(int file) : file_(file) {}
  int file_;
};

// Of the target with most, as many as the line kernel would solve in the same memory.
uint64_t MarkersInMemory(const CalibrationPlan& plan) {
  auto count = static_cast<uint64_t>(plan.target.marker_count());
  bool is_general = !plan.target.IsLine();
  for (const auto& [session_id, other] : plan.other_targets) {
    count = std::max(count, static_cast<uint64_t>(other.marker_count()));
    // A point beside a wand takes the general path too.
    is_general = is_general || other.kind != plan.target.kind || !other.IsLine();
  }
  return is_general ? kGeneralPathFactor * count : count;
}

struct PreparedInput {
  ScratchFile file;
  uint64_t row_count = 0;
  uint64_t marker_count = 0;  // see MarkersInMemory
  std::vector<RowShare> shares;
};

absl::StatusOr<PreparedInput> WriteInput(const SolveTask& task, const WorkerOptions& options,
                                         const std::atomic<bool>& cancelled,
                                         RefusalCounter* refused) {
  RIGCAL_ASSIGN_OR_RETURN(CalibrationPlan plan,
                          PlanCalibration(task.store, task.session_ids, refused));
  // Without sessions there is no target of theirs.
  if (plan.session_ids.empty() && task.parent != nullptr && task.parent->result) {
    plan.target = task.parent->result->target.given;
  }
  RIGCAL_ASSIGN_OR_RETURN(ScratchFile file, ScratchFile::Create(options.scratch_dir));
  PreparedInput input{std::move(file), 0, MarkersInMemory(plan), {}};
  SolveInputWriter writer(input.file.descriptor());
  const auto note = [&options](const absl::Status& status) {
    if (status.ok()) return status;
    return absl::Status(status.code(),
                        absl::StrCat("cannot write the observations for the solve to ",
                                     options.scratch_dir.string(), ": ", status.message()));
  };
  RIGCAL_RETURN_IF_ERROR(note(writer.Begin(plan.target, task.options, plan.tracks, plan.row_limits,
                                           plan.other_targets, task.parent)));
  RIGCAL_RETURN_IF_ERROR(ReadCalibrationRows(task.store, &plan, task.max_observations, cancelled,
                                             refused,
                                             [&](size_t track, const ObservationBatch& batch) {
                                               input.row_count += batch.rows();
                                               return note(writer.AddRows(track, batch));
                                             }));
  RIGCAL_RETURN_IF_ERROR(note(writer.End(refused->List())));
  if (lseek(input.file.descriptor(), 0, SEEK_SET) != 0) {
    return absl::UnavailableError(absl::StrCat("the scratch file: ", strerror(errno)));
  }
  input.shares = std::move(plan.shares);
  return input;
}

std::string StageName(CalibrationStage stage) {
  for (const auto& [value, name] : kCalibrationStageNames) {
    if (value == stage) return std::string(name);
  }
  return "starting";
}

std::string Megabytes(uint64_t bytes) {
  return absl::StrCat((bytes + (1 << 20) - 1) >> 20, " MiB");
}

// One worker at work.
class Solve {
 public:
  Solve(WorkerProcess process, const WorkerOptions& options, const CalibrationHooks& hooks,
        uint64_t memory_bytes, uint64_t row_count)
      : process_(std::move(process)),
        pid_(process_.pid()),
        options_(options),
        hooks_(hooks),
        memory_bytes_(memory_bytes),
        row_count_(row_count),
        life_(options.silence, SteadyClock::now()) {}

  // `refused`: what was left out before the solve.
  CalibrationOutcome Run(std::vector<Refusal> refused) {
    absl::Status status = ReadOutput();
    if (!status.ok()) process_.Kill();
    const int ended = process_.Wait();
    if (outcome_ && status.ok()) return *std::move(outcome_);
    if (status.ok()) status = Describe(ended);
    return {status, std::move(refused)};
  }

 private:
  // Until the worker closes its end.
  absl::Status ReadOutput() {
    while (true) {
      bool ended = false;
      RIGCAL_ASSIGN_OR_RETURN(const std::string bytes,
                              process_.Read(kPipeBytes, kLookInterval, &ended));
      if (*hooks_.cancelled) return absl::CancelledError("the calibration was cancelled");
      if (ended) return absl::OkStatus();
      cutter_.Add(bytes.data(), bytes.size());
      RIGCAL_RETURN_IF_ERROR(TakeMessages());
      RIGCAL_RETURN_IF_ERROR(CheckLife());
    }
  }

  absl::Status CheckLife() {
    const SignsOfLife::State state = life_.Look(SteadyClock::now());
    const auto seconds = [](std::chrono::milliseconds time) { return time.count() / 1000; };
    const auto ended = [this](const auto&... why) {
      return absl::DeadlineExceededError(
          absl::StrCat("the solve was ended: rigcal-worker (process ", pid_, ") ", why...));
    };
    const bool not_responding = state == SignsOfLife::State::kDoubtful;
    switch (state) {
      case SignsOfLife::State::kSilent:
        return ended("gave no sign of life for ", seconds(options_.silence.end), " s while ",
                     StageName(stage_),
                     ". It was stopped, or waited for something that did not come: see the "
                     "system's log, and create the calibration again");
      case SignsOfLife::State::kStuck:
        return ended("got no further for ", seconds(options_.silence.stuck), " s while ",
                     StageName(stage_),
                     "; create the calibration again with fewer sessions, and report it with "
                     "`rigcal session export`");
      default:
        break;
    }
    if (not_responding == not_responding_) return absl::OkStatus();
    not_responding_ = not_responding;
    if (not_responding) {
      spdlog::warn("rigcal-worker (process {}) does not respond while {}; it is ended in {} s",
                   pid_, StageName(stage_), seconds(options_.silence.end - life_.silence()));
    } else {
      spdlog::info("rigcal-worker (process {}) responds again", pid_);
    }
    if (hooks_.silence) hooks_.silence(not_responding);
    return absl::OkStatus();
  }

  absl::Status TakeMessages() {
    worker::v1::SolveOutput message;
    while (true) {
      RIGCAL_ASSIGN_OR_RETURN(const bool complete, cutter_.Next(&message));
      if (!complete) return absl::OkStatus();
      life_.Hear(!message.has_heartbeat());
      if (message.has_progress()) {
        const int stage = message.progress().stage();
        if (v1::CalibrationStage_IsValid(stage)) stage_ = static_cast<CalibrationStage>(stage);
        if (hooks_.progress) hooks_.progress(stage_, message.progress().fraction());
      } else if (message.has_outcome()) {
        RIGCAL_RETURN_IF_ERROR(TakeOutcome(message.outcome()));
      }
    }
  }

  absl::Status TakeOutcome(const worker::v1::SolveOutcome& outcome) {
    RIGCAL_ASSIGN_OR_RETURN(Calibration calibration, wire::ParseCalibration(outcome.calibration()));
    spdlog::info("rigcal-worker (process {}): {} observations, at most {} of memory, {} B each",
                 pid_, row_count_, Megabytes(outcome.peak_memory_bytes()),
                 outcome.peak_memory_bytes() / std::max<uint64_t>(1, row_count_));
    if (outcome.code() == 0 && calibration.result) {
      std::vector<Refusal> refused = calibration.result->refused;
      outcome_.emplace(CalibrationOutcome{*std::move(calibration.result), std::move(refused)});
    } else {
      const auto code = static_cast<absl::StatusCode>(outcome.code());
      outcome_.emplace(CalibrationOutcome{
          absl::Status(outcome.code() == 0 ? absl::StatusCode::kInternal : code, calibration.error),
          std::move(calibration.refused)});
    }
    return absl::OkStatus();
  }

  // Of a worker that ended without an outcome.
  absl::Status Describe(int ended) const {
    const std::string who =
        absl::StrCat("rigcal-worker (process ", pid_, "), which ran the solve of ", row_count_,
                     " observations, ");
    const std::string when = absl::StrCat(" while ", StageName(stage_));
    if (WIFEXITED(ended) && WEXITSTATUS(ended) == kWorkerOutOfMemory) {
      return absl::ResourceExhaustedError(
          absl::StrCat(who, "needed more than its ", Megabytes(memory_bytes_), " of memory", when,
                       "; use fewer sessions, or raise limits.calibration_memory_mb on the "
                       "server"));
    }
    if (WIFSIGNALED(ended) && WTERMSIG(ended) == SIGKILL) {
      return absl::UnavailableError(
          absl::StrCat(who, "was killed", when,
                       " (signal 9): by somebody, or by the system because its memory ran out; "
                       "see the system's log, and create the calibration again"));
    }
    if (WIFSIGNALED(ended)) {
      return absl::InternalError(absl::StrCat(
          who, "crashed", when, " (signal ", WTERMSIG(ended), ", ", strsignal(WTERMSIG(ended)),
          "); this is a fault of rigcal: report it with `rigcal session export`"));
    }
    return absl::InternalError(absl::StrCat(who, "ended", when, " without a result (code ",
                                            WEXITSTATUS(ended),
                                            "); the reason is in the server's log"));
  }

  WorkerProcess process_;
  const pid_t pid_;
  const WorkerOptions& options_;
  const CalibrationHooks& hooks_;
  const uint64_t memory_bytes_, row_count_;
  SignsOfLife life_;
  bool not_responding_ = false;
  MessageCutter cutter_;
  CalibrationStage stage_ = CalibrationStage::kUnspecified;
  std::optional<CalibrationOutcome> outcome_;
};

}  // namespace

SolveFunction SolveInWorker(WorkerOptions options) {
  return [options = std::move(options)](const SolveTask& task, const CalibrationHooks& hooks) {
    RefusalCounter refused;
    const absl::StatusOr<PreparedInput> input =
        WriteInput(task, options, *hooks.cancelled, &refused);
    if (!input.ok()) return CannotRead(input.status(), refused);
    const uint64_t memory_bytes =
        std::min(options.max_memory_bytes, SolveMemoryBytes(input->row_count, input->marker_count));
    absl::StatusOr<WorkerProcess> process = WorkerProcess::Start(
        options.program,
        {absl::StrCat("--parent=", getpid()), absl::StrCat("--memory=", memory_bytes),
         "--log-format=" + LogFormat(), "--log-level=" + LogLevel()},
        input->file.descriptor());
    if (!process.ok()) return CalibrationOutcome{process.status(), refused.List()};
    CalibrationOutcome outcome =
        Solve(*std::move(process), options, hooks, memory_bytes, input->row_count)
            .Run(refused.List());
    if (outcome.result.ok()) {
      NoteIncompleteSessions(input->shares, task.options, &*outcome.result);
    }
    return outcome;
  };
}

absl::StatusOr<std::filesystem::path> FindWorker() {
  std::error_code error;
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", error);
  const std::filesystem::path worker = self.parent_path() / "rigcal-worker";
  if (!error && access(worker.c_str(), X_OK) == 0) return worker;
  return absl::FailedPreconditionError(
      absl::StrCat("there is no rigcal-worker in ", self.parent_path().string(),
                   ", the folder of rigcal-server; it runs the calibrations: install both"));
}

}  // namespace rigcal::server

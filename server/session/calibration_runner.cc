// SPDX-License-Identifier: Apache-2.0
#include "server/session/calibration_runner.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <exception>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/log/correlation_id.h"
#include "common/log/log_fields.h"
#include "common/status/status_macros.h"
#include "server/session/calibration_input.h"
#include "server/session/calibration_request.h"
#include "server/session/session_rules.h"
#include "server/session/utc_clock.h"

namespace rigcal::server {
namespace {

constexpr int kCalibrationPageSize = 200;
constexpr size_t kMaxUnsaved = 64;
// Watchers are not woken more often by progress within a stage.
constexpr std::chrono::milliseconds kProgressInterval{100};
constexpr std::string_view kCancelled = "cancelled";

bool HasEnded(const Calibration& calibration) {
  return calibration.state == CalibrationState::kSucceeded ||
         calibration.state == CalibrationState::kFailed;
}

void Fail(std::string error, Calibration* calibration) {
  calibration->state = CalibrationState::kFailed;
  calibration->error = std::move(error);
  calibration->result.reset();
}

}  // namespace

CalibrationRunner::CalibrationRunner(CalibrationRunnerOptions options, Store* store,
                                     SessionCoordinator* coordinator, SolveFunction solve)
    : options_(std::move(options)),
      store_(store),
      coordinator_(coordinator),
      solve_(std::move(solve)),
      changes_(options_.max_watches) {}

absl::StatusOr<std::unique_ptr<CalibrationRunner>> CalibrationRunner::Create(
    CalibrationRunnerOptions options, Store* store, SessionCoordinator* coordinator,
    SolveFunction solve) {
  std::unique_ptr<CalibrationRunner> runner(
      new CalibrationRunner(std::move(options), store, coordinator, std::move(solve)));
  RIGCAL_RETURN_IF_ERROR(runner->QueueUnfinished());
  return runner;
}

CalibrationRunner::~CalibrationRunner() { Shutdown(); }

void CalibrationRunner::Shutdown() {
  {
    std::lock_guard lock(mutex_);
    stopping_ = true;
    interrupted_ = true;
  }
  tasks_.Shutdown();
}

absl::Status CalibrationRunner::QueueUnfinished() {
  ListPage next{.limit = kCalibrationPageSize};
  size_t page_size = 0;
  do {
    RIGCAL_ASSIGN_OR_RETURN(const auto page, store_->ListCalibrations({}, next));
    page_size = page.size();
    for (const auto& [calibration, position] : page) {
      next.after = position;
      if (HasEnded(calibration)) continue;
      // A session that is gone ends the calibration with its name when its turn comes.
      auto hold = coordinator_->HoldSessions(calibration.session_ids);
      const LogScope scope({.calibration = calibration.id, .correlation = NewCorrelationId()});
      queue_.push_front({calibration.id, hold.ok() ? *std::move(hold) : nullptr,
                         LogFields::Current().correlation});
      tasks_.Post([this] { RunNext(); });
      spdlog::info("calibration {}: queued again after a restart", calibration.id);
    }
  } while (page_size == static_cast<size_t>(kCalibrationPageSize));
  return absl::OkStatus();
}

absl::StatusOr<Calibration> CalibrationRunner::CreateCalibration(
    std::vector<std::string> session_ids, CalibrationOptions options, CalibrationNote note) {
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  RIGCAL_RETURN_IF_ERROR(CheckNamedSessions(session_ids, options));
  std::lock_guard create(create_mutex_);
  RIGCAL_ASSIGN_OR_RETURN(session_ids, SessionsToUse(*store_, std::move(session_ids), &options));
  RIGCAL_ASSIGN_OR_RETURN(auto hold, coordinator_->HoldSessions(session_ids));
  std::vector<Session> sessions;
  for (const std::string& id : session_ids) {
    RIGCAL_ASSIGN_OR_RETURN(Session session, store_->GetSession(id));
    RIGCAL_RETURN_IF_ERROR(CheckNotDiscarded(session));
    sessions.push_back(std::move(session));
  }
  RIGCAL_RETURN_IF_ERROR(CheckSessionsFit(sessions, options));
  if (const size_t queued = QueuedCount(); queued >= options_.max_queued) {
    return absl::ResourceExhaustedError(absl::StrCat(
        queued, " calibrations are queued, which is the limit; ask again later, or cancel some"));
  }
  Calibration calibration;
  if (sessions.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(const Calibration parent, store_->GetCalibration(options.parent_id));
    calibration.rig = parent.rig;
  } else {
    calibration.rig = sessions.front().rig;
  }
  RIGCAL_RETURN_IF_ERROR(ChooseFrame(*store_, calibration.rig, &options));
  calibration.session_ids = std::move(session_ids);
  calibration.options = std::move(options);
  calibration.create_utc_ns = UtcNowNs(options_.utc_now_ns);
  calibration.software_version = options_.software_version;
  calibration.operator_name = std::move(note.operator_name);
  calibration.reason = std::move(note.reason);
  calibration.notes = std::move(note.notes);
  RIGCAL_RETURN_IF_ERROR(Derive(*store_, sessions, &calibration));
  RIGCAL_ASSIGN_OR_RETURN(calibration, store_->CreateCalibration(std::move(calibration)));
  {
    std::lock_guard lock(mutex_);
    queue_.push_back({calibration.id, std::move(hold), LogFields::Current().correlation});
  }
  const LogScope scope({.calibration = calibration.id});
  spdlog::info("calibration {}: queued", calibration.id);
  tasks_.Post([this] { RunNext(); });
  return calibration;
}

absl::StatusOr<Calibration> CalibrationRunner::GetCalibration(std::string_view id) const {
  RIGCAL_ASSIGN_OR_RETURN(Calibration calibration, store_->GetCalibration(id));
  return WithMemory(std::move(calibration));
}

absl::StatusOr<std::vector<Listed<Calibration>>> CalibrationRunner::ListCalibrations(
    const CalibrationFilter& filter, const ListPage& page) const {
  RIGCAL_ASSIGN_OR_RETURN(auto calibrations, store_->ListCalibrations(filter, page));
  for (auto& [calibration, position] : calibrations) {
    calibration = WithMemory(std::move(calibration));
  }
  return calibrations;
}

Calibration CalibrationRunner::WithMemory(Calibration calibration) const {
  if (HasEnded(calibration)) return calibration;
  std::lock_guard lock(mutex_);
  if (const auto unsaved = unsaved_.find(calibration.id); unsaved != unsaved_.end()) {
    return unsaved->second;
  }
  if (calibration.id == running_id_) {
    calibration.progress_stage = stage_;
    calibration.progress_fraction = fraction_;
    calibration.not_responding = not_responding_;
  }
  return calibration;
}

absl::StatusOr<Calibration> CalibrationRunner::CancelCalibration(std::string_view id) {
  Job job;
  {
    std::lock_guard lock(mutex_);
    if (id == running_id_) {
      cancel_asked_ = true;
      interrupted_ = true;
    }
    const auto queued = std::find_if(queue_.begin(), queue_.end(),
                                     [&](const Job& candidate) { return candidate.id == id; });
    if (queued != queue_.end()) {
      job = std::move(*queued);
      queue_.erase(queued);
    }
  }
  RIGCAL_ASSIGN_OR_RETURN(Calibration calibration, GetCalibration(id));
  if (job.id.empty()) return calibration;
  Fail(std::string(kCancelled), &calibration);
  calibration.end_utc_ns = UtcNowNs(options_.utc_now_ns);
  End(calibration);
  return calibration;
}

absl::Status CalibrationRunner::DeleteCalibration(std::string_view id) {
  RIGCAL_RETURN_IF_ERROR(store_->DeleteCalibration(id));
  spdlog::info("calibration {}: deleted", id);
  changes_.Notify(id);
  return absl::OkStatus();
}

size_t CalibrationRunner::QueuedCount() const {
  std::lock_guard lock(mutex_);
  return queue_.size();
}

void CalibrationRunner::RunNext() {
  Job job;
  {
    std::lock_guard lock(mutex_);
    if (stopping_ || queue_.empty()) return;
    job = std::move(queue_.front());
    queue_.pop_front();
    running_id_ = job.id;
    stage_ = CalibrationStage::kReading;
    fraction_ = 0;
    not_responding_ = false;
    cancel_asked_ = false;
    interrupted_ = false;
  }
  RunJob(job);
  std::lock_guard lock(mutex_);
  running_id_.clear();
}

void CalibrationRunner::RunJob(const Job& job) {
  const LogScope scope({.calibration = job.id, .correlation = job.correlation});
  absl::StatusOr<Calibration> calibration = store_->GetCalibration(job.id);
  if (!calibration.ok()) {
    spdlog::error("calibration {}: cannot be read, tried again at the next start: {}", job.id,
                  std::string(calibration.status().message()));
    return;
  }
  if (absl::Status status = Begin(&*calibration); !status.ok()) {
    Fail(std::string(status.message()), &*calibration);
  } else {
    try {
      Solve(&*calibration);
    } catch (const std::exception& error) {
      Fail(absl::StrCat("an unexpected fault while solving: ", error.what()), &*calibration);
    }
  }
  bool cancelled = false;
  bool stopping = false;
  {
    std::lock_guard lock(mutex_);
    cancelled = cancel_asked_;
    stopping = stopping_;
  }
  if (cancelled) {
    Fail(std::string(kCancelled), &*calibration);
  } else if (stopping && calibration->state != CalibrationState::kSucceeded) {
    // A clean stop is no failed attempt: it starts again with the server.
    calibration->state = CalibrationState::kQueued;
    calibration->error.clear();
    calibration->refused.clear();
    calibration->start_utc_ns = 0;
    calibration->attempt_count = 0;
  }
  calibration->progress_stage = CalibrationStage::kUnspecified;
  if (calibration->state != CalibrationState::kQueued) {
    calibration->end_utc_ns = UtcNowNs(options_.utc_now_ns);
  }
  End(*std::move(calibration));
}

absl::Status CalibrationRunner::Begin(Calibration* calibration) {
  if (calibration->attempt_count >= static_cast<uint32_t>(options_.max_attempts)) {
    return absl::InternalError(
        absl::StrCat("the server ended ", options_.max_attempts,
                     " times while it ran this calibration (out of memory?); use fewer "
                     "observations, or create it again"));
  }
  // It may have been asked for in an earlier version.
  RIGCAL_RETURN_IF_ERROR(calibration->options.Validate());
  calibration->state = CalibrationState::kRunning;
  calibration->start_utc_ns = UtcNowNs(options_.utc_now_ns);
  ++calibration->attempt_count;
  if (absl::Status status = store_->UpdateCalibration(*calibration); !status.ok()) {
    return absl::Status(status.code(),
                        absl::StrCat("the calibration cannot be begun: ", status.message()));
  }
  changes_.Notify(calibration->id);
  return absl::OkStatus();
}

void CalibrationRunner::Solve(Calibration* calibration) {
  CalibrationHooks hooks;
  hooks.progress = [this](CalibrationStage stage, double fraction) {
    ReportProgress(stage, fraction);
  };
  hooks.silence = [this](bool not_responding) { ReportSilence(not_responding); };
  hooks.cancelled = &interrupted_;
  const auto start = std::chrono::steady_clock::now();
  const absl::StatusOr<std::optional<Calibration>> parent = ParentOf(*store_, calibration->options);
  if (!parent.ok()) return Fail(std::string(parent.status().message()), calibration);
  CalibrationOutcome outcome = solve_({.store = *store_,
                                       .session_ids = calibration->session_ids,
                                       .max_observations = options_.max_observations,
                                       .options = calibration->options,
                                       .parent = *parent ? &**parent : nullptr},
                                      hooks);
  calibration->duration_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (!outcome.result.ok()) {
    calibration->refused = std::move(outcome.refused);
    return Fail(std::string(outcome.result.status().message()), calibration);
  }
  calibration->state = CalibrationState::kSucceeded;
  calibration->progress_fraction = 1;
  calibration->result = *std::move(outcome.result);
}

void CalibrationRunner::End(Calibration calibration) {
  if (absl::Status status = store_->UpdateCalibration(calibration); !status.ok()) {
    spdlog::error("calibration {}: its end cannot be stored: {}", calibration.id,
                  std::string(status.message()));
    // The store still says that it is queued or running, so the next start tries again.
    if (calibration.state == CalibrationState::kSucceeded) {
      Fail(absl::StrCat("the result cannot be stored: ", status.message(),
                        "; it is calculated again when the server starts next"),
           &calibration);
    }
    std::lock_guard lock(mutex_);
    if (unsaved_.size() < kMaxUnsaved) unsaved_.insert_or_assign(calibration.id, calibration);
  }
  switch (calibration.state) {
    case CalibrationState::kSucceeded:
      spdlog::info("calibration {}: succeeded in {:.1f} s", calibration.id, calibration.duration_s);
      break;
    case CalibrationState::kFailed:
      spdlog::warn("calibration {}: failed: {}", calibration.id, calibration.error);
      break;
    default:
      spdlog::info("calibration {}: queued again for the next start", calibration.id);
  }
  changes_.Notify(calibration.id);
}

void CalibrationRunner::ReportSilence(bool not_responding) {
  std::string id;
  {
    std::lock_guard lock(mutex_);
    not_responding_ = not_responding;
    id = running_id_;
  }
  changes_.Notify(id);
}

void CalibrationRunner::ReportProgress(CalibrationStage stage, double fraction) {
  std::string id;
  {
    std::lock_guard lock(mutex_);
    const auto now = std::chrono::steady_clock::now();
    const bool due = stage != stage_ || now - last_notification_ >= kProgressInterval;
    stage_ = stage;
    fraction_ = fraction;
    if (!due) return;
    last_notification_ = now;
    id = running_id_;
  }
  changes_.Notify(id);
}

}  // namespace rigcal::server

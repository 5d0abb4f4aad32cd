// SPDX-License-Identifier: Apache-2.0
#include "server/session/calibration_runner.h"

#include <spdlog/spdlog.h>

#include <algorithm>
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

constexpr size_t kMaxUnsaved = 64;
constexpr int kLooksAtWorkers = 4;  // their list is read at every fourth look: once a second
// Watchers are not woken more often by progress within a stage.
constexpr std::chrono::milliseconds kProgressInterval{100};

}  // namespace

CalibrationRunner::CalibrationRunner(CalibrationRunnerOptions options, Store* store,
                                     SessionCoordinator* coordinator, SolveFunction solve)
    : options_(std::move(options)),
      store_(store),
      coordinator_(coordinator),
      changes_(options_.max_watches),
      solver_({.holder = ThisHolder(options_.software_version, true),
               .max_attempts = options_.max_attempts,
               .max_observations = options_.max_observations,
               .only_to_end = !options_.solve_here,
               .utc_now_ns = options_.utc_now_ns},
              store, std::move(solve), SolverEvents()) {}

JobSolver::Events CalibrationRunner::SolverEvents() {
  return {.correlation =
              [this](const std::string& id) {
                std::lock_guard lock(mutex_);
                const auto found = unfinished_.find(id);
                return found == unfinished_.end() ? std::string() : found->second.correlation;
              },
          .begun = [this](const Calibration& calibration) { NoteBegun(calibration); },
          .progress = [this](const std::string& id,
                             const JobProgress& progress) { NoteProgress(id, progress); },
          .ended = [this](const Calibration& calibration,
                          const absl::Status& stored) { NoteEnd(calibration, stored); }};
}

absl::StatusOr<std::unique_ptr<CalibrationRunner>> CalibrationRunner::Create(
    CalibrationRunnerOptions options, Store* store, SessionCoordinator* coordinator,
    SolveFunction solve) {
  if (!options.solve_here && !store->jobs_are_shared()) {
    return absl::InvalidArgumentError(
        "this server is not to solve (solve.local = false or --no-solve), and nobody else can: its "
        "database is a file of its own. Name one that rigcal-workers reach (--store "
        "postgresql://...), or let it solve");
  }
  std::unique_ptr<CalibrationRunner> runner(
      new CalibrationRunner(std::move(options), store, coordinator, std::move(solve)));
  RIGCAL_RETURN_IF_ERROR(runner->QueueUnfinished());
  return runner;
}

CalibrationRunner::~CalibrationRunner() { Shutdown(); }

void CalibrationRunner::Start() {
  tasks_.Start();
  if (store_->jobs_are_shared()) follower_ = std::thread([this] { Follow(); });
}

void CalibrationRunner::Shutdown() {
  {
    std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  solver_.Interrupt();
  if (follower_.joinable()) follower_.join();
  tasks_.Shutdown();
}

absl::Status CalibrationRunner::QueueUnfinished() {
  RIGCAL_RETURN_IF_ERROR(store_->AdoptJobs(options_.software_version));
  RIGCAL_ASSIGN_OR_RETURN(std::vector<CalibrationJob> jobs, store_->ListJobs());
  for (CalibrationJob& job : jobs) {
    const std::string id = job.calibration_id;
    const LogScope scope({.calibration = id, .correlation = NewCorrelationId()});
    if (job.state == CalibrationState::kRunning) {
      spdlog::info("calibration {}: {} solves it", id, NameOf(job.holder));
    } else {
      spdlog::info("calibration {}: queued again after a restart", id);
      PostRun();
    }
    unfinished_.insert_or_assign(id, AddUnfinished(std::move(job)));
  }
  return absl::OkStatus();
}

// With the log's correlation of the calling thread.
CalibrationRunner::Unfinished CalibrationRunner::AddUnfinished(CalibrationJob job) const {
  // A session that is gone ends the calibration with its name when its turn comes.
  auto hold = coordinator_->HoldSessions(job.session_ids);
  return {.hold = hold.ok() ? *std::move(hold) : nullptr,
          .correlation = LogFields::Current().correlation,
          .job = std::move(job),
          .waiting = {}};
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
    Unfinished& unfinished = unfinished_[calibration.id];
    unfinished.hold = std::move(hold);
    unfinished.correlation = LogFields::Current().correlation;
    unfinished.job.calibration_id = calibration.id;
  }
  const LogScope scope({.calibration = calibration.id});
  spdlog::info("calibration {}: queued", calibration.id);
  PostRun();
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
  if (HasEnded(calibration.state)) return calibration;
  std::optional<JobProgress> progress = solver_.ProgressOf(calibration.id);
  std::lock_guard lock(mutex_);
  if (const auto unsaved = unsaved_.find(calibration.id); unsaved != unsaved_.end()) {
    return unsaved->second;
  }
  if (const auto found = unfinished_.find(calibration.id); found != unfinished_.end()) {
    const CalibrationJob& job = found->second.job;
    calibration.waiting = found->second.waiting;
    if (!progress && job.state == CalibrationState::kRunning && !job.holder.is_server) {
      progress = job.progress;
      calibration.solved_by = NameOf(job.holder);
    }
  }
  if (progress) {
    calibration.progress_stage = progress->stage;
    calibration.progress_fraction = progress->fraction;
    calibration.not_responding = progress->not_responding;
  }
  return calibration;
}

absl::StatusOr<Calibration> CalibrationRunner::CancelCalibration(std::string_view id) {
  if (solver_.Cancel(id)) return GetCalibration(id);
  RIGCAL_ASSIGN_OR_RETURN(Calibration calibration,
                          store_->CancelJob(id, UtcNowNs(options_.utc_now_ns)));
  if (!HasEnded(calibration.state)) {
    solver_.Cancel(id);  // claimed meanwhile
    return WithMemory(std::move(calibration));
  }
  decltype(unfinished_)::node_type ended;  // its hold is released without the lock
  {
    std::lock_guard lock(mutex_);
    ended = unfinished_.extract(calibration.id);
  }
  if (ended) {
    spdlog::warn("calibration {}: failed: {}", calibration.id, calibration.error);
    changes_.Notify(id);
  }
  return WithMemory(std::move(calibration));
}

absl::Status CalibrationRunner::DeleteCalibration(std::string_view id) {
  RIGCAL_RETURN_IF_ERROR(store_->DeleteCalibration(id));
  spdlog::info("calibration {}: deleted", id);
  changes_.Notify(id);
  return absl::OkStatus();
}

size_t CalibrationRunner::QueuedCount() const {
  std::lock_guard lock(mutex_);
  return static_cast<size_t>(std::ranges::count_if(unfinished_, [this](const auto& entry) {
    return entry.second.job.state == CalibrationState::kQueued && !unsaved_.contains(entry.first);
  }));
}

std::vector<SolveWorker> CalibrationRunner::Workers() const {
  std::vector<SolveWorker> workers;
  {
    std::lock_guard lock(mutex_);
    workers = workers_;
  }
  if (!options_.solve_here) return workers;
  SolveWorker here;
  here.holder = ThisHolder(options_.software_version, true);
  here.is_alive = true;
  {
    std::lock_guard lock(mutex_);
    here.start_utc_ns = start_utc_ns_;
    for (const auto& [id, unfinished] : unfinished_) {
      if (solver_.ProgressOf(id)) here.calibration_ids.push_back(id);
    }
  }
  here.heartbeat_utc_ns = UtcNowNs(options_.utc_now_ns);
  workers.insert(workers.begin(), std::move(here));
  return workers;
}

void CalibrationRunner::PostRun() {
  tasks_.Post([this] { RunNext(); });
}

void CalibrationRunner::RunNext() {
  {
    std::lock_guard lock(mutex_);
    is_run_posted_ = false;
    if (stopping_) return;
  }
  if (const absl::Status claimed = solver_.RunOne().status(); !claimed.ok()) NoteNotBegun(claimed);
}

void CalibrationRunner::NoteNotBegun(const absl::Status& why) {
  // The queue is looked at again in a moment.
  if (store_->jobs_are_shared() && absl::IsUnavailable(why)) return;
  std::string id;
  {
    std::lock_guard lock(mutex_);
    for (const auto& [candidate, unfinished] : unfinished_) {
      if (unfinished.job.state == CalibrationState::kQueued && !unsaved_.contains(candidate)) {
        id = candidate;
        break;
      }
    }
  }
  if (id.empty()) return;
  auto calibration = store_->GetCalibration(id);
  if (!calibration.ok()) calibration = Calibration();
  calibration->id = id;
  calibration->state = CalibrationState::kFailed;
  calibration->error = absl::StrCat("the calibration cannot be begun: ", why.message());
  calibration->end_utc_ns = UtcNowNs(options_.utc_now_ns);
  spdlog::warn("calibration {}: {}", id, calibration->error);
  {
    std::lock_guard lock(mutex_);
    if (unsaved_.size() < kMaxUnsaved) unsaved_.insert_or_assign(id, *std::move(calibration));
  }
  changes_.Notify(id);
}

void CalibrationRunner::NoteBegun(const Calibration& calibration) {
  {
    std::lock_guard lock(mutex_);
    CalibrationJob& job = unfinished_[calibration.id].job;
    job.state = CalibrationState::kRunning;
    job.holder.is_server = true;
    last_progress_ = {};
    unsaved_.erase(calibration.id);
  }
  changes_.Notify(calibration.id);
}

void CalibrationRunner::NoteProgress(const std::string& id, const JobProgress& progress) {
  {
    std::lock_guard lock(mutex_);
    const auto now = std::chrono::steady_clock::now();
    const bool is_news = progress.stage != last_progress_.stage ||
                         progress.not_responding != last_progress_.not_responding;
    if (!is_news && now - last_notification_ < kProgressInterval) return;
    last_progress_ = progress;
    last_notification_ = now;
  }
  changes_.Notify(id);
}

void CalibrationRunner::NoteEnd(Calibration calibration, const absl::Status& stored) {
  const std::string id = calibration.id;
  if (absl::IsAborted(stored)) {
    changes_.Notify(id);
    return;  // it is followed
  }
  if (!stored.ok()) {
    spdlog::error("calibration {}: its end cannot be stored: {}", id,
                  std::string(stored.message()));
    // The store still says that it is running, so the next start tries again.
    if (calibration.state == CalibrationState::kSucceeded) {
      calibration.state = CalibrationState::kFailed;
      calibration.result.reset();
      calibration.error = absl::StrCat("the result cannot be stored: ", stored.message(),
                                       "; it is calculated again when the server starts next");
    }
  }
  switch (calibration.state) {
    case CalibrationState::kSucceeded:
      spdlog::info("calibration {}: succeeded in {:.1f} s", id, calibration.duration_s);
      break;
    case CalibrationState::kCancelled:
      spdlog::info("calibration {}: cancelled", id);
      break;
    case CalibrationState::kFailed:
      spdlog::warn("calibration {}: failed: {}", id, calibration.error);
      break;
    default:
      spdlog::info("calibration {}: queued again", id);
  }
  decltype(unfinished_)::node_type ended;  // its hold is released without the lock
  {
    std::lock_guard lock(mutex_);
    if (!stored.ok()) {
      if (unsaved_.size() < kMaxUnsaved) unsaved_.insert_or_assign(id, std::move(calibration));
    } else if (HasEnded(calibration.state)) {
      ended = unfinished_.extract(id);
    } else {
      unfinished_[id].job.state = CalibrationState::kQueued;
    }
  }
  ended = {};
  changes_.Notify(id);
}

void CalibrationRunner::Follow() {
  bool is_away = false;
  std::unique_lock lock(mutex_);
  while (!wake_.wait_for(lock, kJobPoll, [this] { return stopping_; })) {
    lock.unlock();
    const absl::Status looked = Look();
    if (!looked.ok() && !is_away) {
      spdlog::warn("the queue of calibrations cannot be read: {}", std::string(looked.message()));
    }
    is_away = !looked.ok();
    lock.lock();
  }
}

absl::Status CalibrationRunner::Look() {
  std::vector<std::string> known;
  {
    std::lock_guard lock(mutex_);
    for (const auto& [id, unfinished] : unfinished_) known.push_back(id);
  }
  RIGCAL_ASSIGN_OR_RETURN(std::vector<CalibrationJob> jobs, store_->ListJobs());
  std::vector<SolveWorker> workers;
  if (look_count_++ % kLooksAtWorkers == 0) {
    RIGCAL_ASSIGN_OR_RETURN(workers, store_->ListWorkers());
    std::lock_guard lock(mutex_);
    workers_ = workers;
  } else {
    std::lock_guard lock(mutex_);
    workers = workers_;
  }
  const auto is_of_another_version = [this](const CalibrationJob& job) {
    return job.software_version != options_.software_version &&
           (job.state == CalibrationState::kQueued || job.lease_is_over);
  };
  if (std::ranges::any_of(jobs, is_of_another_version)) {
    RIGCAL_RETURN_IF_ERROR(store_->AdoptJobs(options_.software_version));
  }
  TakeJobs(known, std::move(jobs), workers);
  return absl::OkStatus();
}

void CalibrationRunner::TakeJobs(const std::vector<std::string>& known,
                                 std::vector<CalibrationJob> jobs,
                                 const std::vector<SolveWorker>& workers) {
  std::vector<std::string> changed;
  std::map<std::string, Unfinished> ended;  // their holds are released without the lock
  bool is_run_due = false;
  std::vector<std::string> listed;
  for (CalibrationJob& job : jobs) {
    const std::string id = job.calibration_id;
    listed.push_back(id);
    is_run_due = is_run_due || IsForThisServer(job);
    const bool is_known = std::ranges::find(known, id) != known.end();
    Unfinished added = is_known ? Unfinished{} : AddUnfinished(job);
    std::string waiting = WhyNobodySolves(job, workers);
    std::lock_guard lock(mutex_);
    const auto found = unfinished_.find(id);
    if (found == unfinished_.end()) {
      if (is_known) continue;  // it has ended since
      unfinished_.emplace(id, std::move(added));
      changed.push_back(id);
      continue;
    }
    Unfinished& entry = found->second;
    if (entry.job.state != job.state || !(entry.job.progress == job.progress) ||
        !(entry.job.holder == job.holder) || entry.waiting != waiting) {
      changed.push_back(id);
    }
    if (!waiting.empty() && entry.waiting != waiting) {
      spdlog::warn("calibration {}: {}", id, waiting);
    }
    entry.job = std::move(job);
    entry.waiting = std::move(waiting);
  }
  {
    std::lock_guard lock(mutex_);
    for (const std::string& id : known) {
      if (std::ranges::find(listed, id) != listed.end() || solver_.ProgressOf(id)) continue;
      if (auto node = unfinished_.extract(id)) {
        ended.emplace(id, std::move(node.mapped()));
        changed.push_back(id);
      }
    }
    is_run_due = is_run_due && !is_run_posted_;
    is_run_posted_ = is_run_posted_ || is_run_due;
  }
  if (is_run_due) PostRun();
  for (const auto& [id, entry] : ended) {
    spdlog::info("calibration {}: ended by {}", id, NameOf(entry.job.holder));
  }
  for (const std::string& id : changed) changes_.Notify(id);
}

bool CalibrationRunner::IsForThisServer(const CalibrationJob& job) const {
  if (job.state == CalibrationState::kRunning && !job.lease_is_over) return false;
  return options_.solve_here || job.cancel || job.attempts >= options_.max_attempts;
}

std::string CalibrationRunner::WhyNobodySolves(const CalibrationJob& job,
                                               const std::vector<SolveWorker>& workers) const {
  const bool waits = job.state == CalibrationState::kQueued || job.lease_is_over;
  if (!waits || options_.solve_here) return "";
  const SolveWorker* other = nullptr;
  for (const SolveWorker& worker : workers) {
    if (!worker.is_alive) continue;
    if (worker.holder.software_version == options_.software_version) return "";  // all are busy
    other = &worker;
  }
  if (other == nullptr) {
    return "no rigcal-worker runs, and this server does not solve (solve.local = false): start "
           "`rigcal-worker --store ...` on a PC that reaches the database";
  }
  return absl::StrCat("no rigcal-worker of version ", options_.software_version,
                      ", that of this server, runs; the one on ", other->holder.host, " has ",
                      other->holder.software_version, ": install the server's version there");
}

}  // namespace rigcal::server

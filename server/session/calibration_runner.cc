// SPDX-License-Identifier: Apache-2.0
#include "server/session/calibration_runner.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <set>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "common/status/fault_list.h"
#include "common/status/status_macros.h"
#include "server/session/calibration_input.h"
#include "server/session/utc_clock.h"

namespace rigcal::server {
namespace {

constexpr int kCalibrationPageSize = 200;
constexpr std::string_view kCancelled = "cancelled";

bool HasEnded(const Calibration& calibration) {
  return calibration.state == CalibrationState::kSucceeded ||
         calibration.state == CalibrationState::kFailed;
}

}  // namespace

absl::Status CalibrationRunnerOptions::Validate() const {
  FaultList faults;
  if (max_queued == 0) faults.Add("max_queued must be at least 1");
  if (max_sessions_per_calibration == 0) {
    faults.Add("max_sessions_per_calibration must be at least 1");
  }
  if (max_observations == 0) faults.Add("max_observations must be at least 1");
  if (max_attempts < 1) faults.Add("max_attempts must be at least 1");
  return faults.Result();
}

CalibrationRunner::CalibrationRunner(CalibrationRunnerOptions options, Store* store,
                                     SessionCoordinator* coordinator, CalibrateFunction calibrate)
    : options_(std::move(options)),
      store_(store),
      coordinator_(coordinator),
      calibrate_(std::move(calibrate)),
      changes_(options_.max_watches) {}

absl::StatusOr<std::unique_ptr<CalibrationRunner>> CalibrationRunner::Create(
    CalibrationRunnerOptions options, Store* store, SessionCoordinator* coordinator,
    CalibrateFunction calibrate) {
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  std::unique_ptr<CalibrationRunner> runner(
      new CalibrationRunner(std::move(options), store, coordinator, std::move(calibrate)));
  RIGCAL_RETURN_IF_ERROR(runner->QueueUnfinished());
  return runner;
}

CalibrationRunner::~CalibrationRunner() { Shutdown(); }

absl::Status CalibrationRunner::QueueUnfinished() {
  std::string before;
  size_t page_size = 0;
  do {
    RIGCAL_ASSIGN_OR_RETURN(const std::vector<Calibration> page,
                            store_->ListCalibrations("", kCalibrationPageSize, before));
    page_size = page.size();
    for (const Calibration& calibration : page) {
      before = calibration.id;
      if (HasEnded(calibration)) continue;
      // A session that is gone ends the calibration with its name when its turn comes.
      auto hold = coordinator_->HoldSessions(calibration.session_ids);
      queue_.push_front({calibration.id, hold.ok() ? *std::move(hold) : nullptr});
      spdlog::info("calibration {}: queued again after a restart", calibration.id);
    }
  } while (page_size == static_cast<size_t>(kCalibrationPageSize));
  return absl::OkStatus();
}

absl::StatusOr<Calibration> CalibrationRunner::CreateCalibration(
    std::vector<std::string> session_ids, CalibrationOptions options) {
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  if (session_ids.empty()) {
    return absl::InvalidArgumentError("session_ids is empty; name at least one finished session");
  }
  if (session_ids.size() > options_.max_sessions_per_calibration) {
    return absl::InvalidArgumentError(
        absl::StrCat("session_ids names ", session_ids.size(), " sessions; at most ",
                     options_.max_sessions_per_calibration, " are allowed"));
  }
  std::set<std::string_view> distinct;
  for (const std::string& id : session_ids) {
    if (!distinct.insert(id).second) {
      return absl::InvalidArgumentError(absl::StrCat("session_ids names '", id, "' twice"));
    }
  }

  std::lock_guard create(create_mutex_);
  RIGCAL_ASSIGN_OR_RETURN(auto hold, coordinator_->HoldSessions(session_ids));
  std::vector<Session> sessions;
  for (const std::string& id : session_ids) {
    RIGCAL_ASSIGN_OR_RETURN(Session session, store_->GetSession(id));
    sessions.push_back(std::move(session));
  }
  RIGCAL_RETURN_IF_ERROR(CheckSessionsFit(sessions));
  if (const size_t queued = QueuedCount(); queued >= options_.max_queued) {
    return absl::ResourceExhaustedError(absl::StrCat(
        queued, " calibrations are queued, which is the limit; ask again later, or cancel some"));
  }
  Calibration calibration;
  calibration.rig = sessions.front().rig;
  calibration.session_ids = std::move(session_ids);
  calibration.options = std::move(options);
  calibration.create_utc_ns = UtcNowNs(options_.utc_now_ns);
  calibration.software_version = options_.software_version;
  RIGCAL_ASSIGN_OR_RETURN(calibration, store_->CreateCalibration(std::move(calibration)));
  {
    std::lock_guard lock(mutex_);
    queue_.push_back({calibration.id, std::move(hold)});
  }
  wake_.notify_all();
  return calibration;
}

absl::StatusOr<Calibration> CalibrationRunner::GetCalibration(std::string_view id) const {
  RIGCAL_ASSIGN_OR_RETURN(Calibration calibration, store_->GetCalibration(id));
  return WithMemory(std::move(calibration));
}

absl::StatusOr<std::vector<Calibration>> CalibrationRunner::ListCalibrations(
    std::string_view rig, int limit, std::string_view before) const {
  RIGCAL_ASSIGN_OR_RETURN(std::vector<Calibration> calibrations,
                          store_->ListCalibrations(rig, limit, before));
  for (Calibration& calibration : calibrations) calibration = WithMemory(std::move(calibration));
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
  calibration.state = CalibrationState::kFailed;
  calibration.error = kCancelled;
  calibration.end_utc_ns = UtcNowNs(options_.utc_now_ns);
  End(calibration);
  return calibration;
}

absl::StatusOr<std::unique_ptr<ChangeNotifier::Watch>> CalibrationRunner::WatchCalibration(
    std::string_view id) {
  RIGCAL_RETURN_IF_ERROR(store_->GetCalibration(id).status());
  return changes_.Add(id);
}

size_t CalibrationRunner::QueuedCount() const {
  std::lock_guard lock(mutex_);
  return queue_.size();
}

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#include "server/monitor/rig_monitor.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <exception>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/status/status_macros.h"
#include "server/monitor/look_result.h"
#include "server/session/utc_clock.h"
#include "server/solve/derivation.h"
#include "server/solve/evaluate/rig_difference.h"

namespace rigcal::server {
namespace {

constexpr int kListedSessions = 8;
// With fewer views of the wand a camera only makes the solve fail.
constexpr uint64_t kLeastWandViews = 20;
constexpr size_t kMaxEnded = 64;

double SecondsBetween(int64_t from_utc_ns, int64_t to_utc_ns) {
  return std::max(0.0, 1e-9 * static_cast<double>(to_utc_ns - from_utc_ns));
}

// By the last look.
std::vector<std::string> CamerasSaid(const LiveMonitor& shown, MonitorVerdict verdict) {
  std::vector<std::string> names;
  for (const LiveMonitoredCamera& camera : shown.cameras) {
    if (camera.verdict == verdict && camera.time_utc_ns == shown.time_utc_ns) {
      names.push_back(camera.camera);
    }
  }
  return names;
}

}  // namespace

RigMonitor::RigMonitor(RigMonitorOptions options, RigMonitorParts parts)
    : options_(std::move(options)),
      parts_(std::move(parts)),
      repairs_({.least_repair_s = options_.least_repair_s, .utc_now_ns = options_.utc_now_ns},
               parts_.store, parts_.runner, parts_.audit) {}

void RigMonitor::Start() {
  thread_ = std::thread([this] { Run(); });
}

void RigMonitor::Shutdown() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void RigMonitor::Run() {
  while (true) {
    {
      std::unique_lock lock(mutex_);
      if (wake_.wait_for(lock, options_.poll_interval, [this] { return stopping_.load(); })) return;
    }
    try {
      Step();
    } catch (const std::exception& error) {
      spdlog::error("monitor: {}", error.what());
    }
  }
}

void RigMonitor::Step() {
  const std::map<std::string, MonitorMode> modes = parts_.settings->All();
  for (auto rig = rigs_.begin(); rig != rigs_.end();) {
    if (modes.contains(rig->first)) {
      ++rig;
      continue;
    }
    parts_.show(rig->first, LiveMonitor{});
    rig = rigs_.erase(rig);
  }
  for (const auto& [name, mode] : modes) {
    if (stopping_) return;
    Rig& rig = rigs_[name];
    StepRig(name, mode, &rig);
    parts_.show(name, rig.shown);
  }
}

void RigMonitor::StepRig(const std::string& name, MonitorMode mode, Rig* rig) {
  if (rig->since_utc_ns == 0) rig->since_utc_ns = UtcNowNs(options_.utc_now_ns);
  rig->shown.mode = mode;
  if (rig->repair && repairs_.Follow(name, *rig->repair, &rig->shown)) rig->repair.reset();
  if (const absl::Status status = TakeActive(name, rig); !status.ok()) {
    rig->shown.problem = std::string(status.message());
    return;
  }
  if (rig->repair) return;  // it decides what the next look is compared with
  for (const Session& session : FinishedSessions(name, *rig)) {
    LookAtEnd(name, session, rig);
    if (stopping_ || rig->repair) return;
  }
  const std::optional<Session> session = CapturingSession(name);
  if (!session) return;
  Follow(*session, rig);
  const double now_s = SecondsBetween(session->start_utc_ns, UtcNowNs(options_.utc_now_ns));
  const double due_s =
      rig->look_count == 0 ? options_.first_look_s : rig->last_look_s + options_.look_interval_s;
  if (now_s < due_s) return;
  Look(*session, std::max(rig->clean_from_s, now_s - options_.window_s), now_s, rig);
}

absl::Status RigMonitor::TakeActive(const std::string& name, Rig* rig) {
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<Activation> latest,
                          parts_.store->ListActivations(name, 1));
  const std::string id = latest.empty() ? std::string() : latest.front().calibration_id;
  if (rig->active && id == rig->shown.calibration_id) return absl::OkStatus();
  rig->active.reset();
  rig->shown.calibration_id = id;
  rig->shown.cameras.clear();
  rig->shown.all_moved = false;
  rig->shown.problem.clear();
  rig->session_id.clear();  // what was seen of it was against another calibration
  if (id.empty()) {
    return absl::FailedPreconditionError(absl::StrCat(
        "rig '", name, "' has no active calibration; `rigcal rig activate ID` makes one so"));
  }
  RIGCAL_ASSIGN_OR_RETURN(Calibration active, parts_.store->GetCalibration(id));
  if (!active.result) return absl::InternalError(absl::StrCat("calibration ", id, " is empty"));
  rig->active = std::move(*active.result);
  rig->active->residuals.clear();  // not needed, and large
  for (const CalibratedCamera& camera : rig->active->cameras) {
    rig->shown.cameras.emplace_back().camera = camera.camera;
  }
  return absl::OkStatus();
}

void RigMonitor::Follow(const Session& session, Rig* rig) {
  if (rig->session_id == session.id) return;
  rig->session_id = session.id;
  rig->look_count = 0;
  rig->last_look_s = rig->clean_from_s = 0;
  rig->seen_good.clear();
  rig->first_look.reset();
  for (LiveMonitoredCamera& camera : rig->shown.cameras) {
    camera.clock_changed = false;
    camera.clock_change_s = camera.clock_change_sigma_s = camera.clock_change_ppm = 0;
  }
}

std::optional<Session> RigMonitor::CapturingSession(const std::string& name) const {
  for (Session& session : parts_.coordinator->ActiveSessions()) {
    if (session.rig == name && session.state == SessionState::kCapturing) {
      return std::move(session);
    }
  }
  return std::nullopt;
}

std::vector<Session> RigMonitor::FinishedSessions(const std::string& name, const Rig& rig) const {
  std::vector<Session> sessions;
  const auto listed = parts_.store->ListSessions({.rig = name, .state = SessionState::kFinished},
                                                 {.limit = kListedSessions});
  if (!listed.ok()) return sessions;
  for (const auto& [summary, position] : *listed) {
    const Session& session = summary.session;
    if (!summary.damage.empty() || session.finish_utc_ns < rig.since_utc_ns ||
        session.discard_utc_ns != 0 || rig.ended.contains(session.id)) {
      continue;
    }
    absl::StatusOr<Session> whole = parts_.store->GetSession(session.id);
    if (whole.ok()) sessions.push_back(*std::move(whole));
  }
  std::ranges::sort(sessions, {}, &Session::finish_utc_ns);
  return sessions;
}

void RigMonitor::Look(const Session& session, double from_s, double now_s, Rig* rig) {
  LiveMonitor& shown = rig->shown;
  ++rig->look_count;
  rig->last_look_s = now_s;
  shown.session_id = session.id;
  shown.time_utc_ns = UtcNowNs(options_.utc_now_ns);
  CalibrationOptions options = LookOptions(*rig->active);
  options.parent_id = shown.calibration_id;
  options.from_s = from_s;
  const auto counts = parts_.store->GetSessionCounts(session.id);
  if (!counts.ok()) {
    shown.problem = std::string(counts.status().message());
    return;
  }
  for (const SessionCameraCounts& camera : *counts) {
    const bool known = std::ranges::find(rig->active->cameras, camera.camera,
                                         &CalibratedCamera::camera) != rig->active->cameras.end();
    if (!known || camera.wand_count < kLeastWandViews) {
      options.without_cameras.push_back(camera.camera);
    }
  }
  if (options.without_cameras.size() + 2 > counts->size()) {
    shown.problem = absl::StrCat("fewer than two cameras of calibration ", shown.calibration_id,
                                 " have seen the wand in session ", session.id);
    return;
  }
  const std::vector<std::string> ids = {session.id};
  CalibrationHooks hooks;
  hooks.cancelled = &stopping_;
  const CalibrationOutcome outcome = parts_.look({.store = *parts_.store,
                                                  .session_ids = ids,
                                                  .max_observations = options_.max_observations,
                                                  .options = options},
                                                 hooks);
  if (stopping_) return;
  if (!outcome.result.ok()) {
    shown.problem = absl::StrCat("nothing can be told by session ", session.id, ": ",
                                 std::string(outcome.result.status().message()));
    return;
  }
  const absl::StatusOr<RigDifference> difference = CompareRigs(*rig->active, *outcome.result);
  if (!difference.ok()) {
    shown.problem = std::string(difference.status().message());
    return;
  }
  const std::set<std::string> within = MovedWithin(*outcome.result);
  TakeVerdicts(*difference, within, shown.time_utc_ns, &shown);
  // One that was good before in this session has moved within the rows of this look: the next one
  // begins behind them.
  bool moved_now = !within.empty();
  for (const LiveMonitoredCamera& camera : shown.cameras) {
    if (camera.time_utc_ns != shown.time_utc_ns) continue;
    if (camera.verdict == MonitorVerdict::kGood) rig->seen_good.insert(camera.camera);
    if (camera.verdict == MonitorVerdict::kMoved && rig->seen_good.erase(camera.camera) > 0) {
      moved_now = true;
    }
  }
  if (moved_now) rig->clean_from_s = now_s;
  spdlog::debug("monitor: session {} from {:.1f} s on, at {:.1f} s: good [{}], moved [{}]{}",
                session.id, from_s, now_s,
                absl::StrJoin(CamerasSaid(shown, MonitorVerdict::kGood), ", "),
                absl::StrJoin(CamerasSaid(shown, MonitorVerdict::kMoved), ", "),
                shown.problem.empty() ? "" : "; " + shown.problem);
  if (!rig->first_look) {
    rig->first_look = *outcome.result;
    rig->first_look->residuals.clear();
    return;
  }
  const auto changes = CompareClocks(*rig->first_look, *outcome.result);
  for (LiveMonitoredCamera& camera : shown.cameras) {
    const auto change = changes.find(camera.camera);
    if (change == changes.end()) continue;
    camera.clock_change_s = change->second.change_s;
    camera.clock_change_sigma_s = change->second.sigma_s;
    camera.clock_change_ppm = change->second.ppm;
    camera.clock_changed = change->second.changed;
  }
}

void RigMonitor::LookAtEnd(const std::string& name, const Session& session, Rig* rig) {
  Follow(session, rig);
  const int64_t stop_utc_ns =
      session.stop_utc_ns != 0 ? session.stop_utc_ns : session.finish_utc_ns;
  const double duration_s = SecondsBetween(session.start_utc_ns, stop_utc_ns);
  // Of a session that nobody has looked at: all of it.
  const double from_s =
      rig->look_count == 0 ? 0 : std::max(rig->clean_from_s, duration_s - options_.window_s);
  if (const double clean_from_s = rig->clean_from_s; clean_from_s > 0) {
    // Rows that came late can make a look while capturing take a camera for one that has just
    // moved: all rows together tell.
    rig->clean_from_s = 0;
    rig->seen_good.clear();
    Look(session, 0, duration_s, rig);
    const bool moved_within = rig->clean_from_s > 0 || !rig->shown.problem.empty();
    rig->seen_good.clear();
    if (moved_within) {
      rig->clean_from_s = clean_from_s;
      Look(session, from_s, duration_s, rig);
    }
  } else {
    Look(session, from_s, duration_s, rig);
  }
  if (stopping_) return;
  if (rig->ended.size() >= kMaxEnded) {
    rig->ended.clear();
    rig->since_utc_ns = session.finish_utc_ns;
  }
  rig->ended.insert(session.id);
  if (rig->shown.mode == MonitorMode::kRepair) {
    rig->repair = repairs_.Begin(name, session, rig->clean_from_s, duration_s, &rig->shown);
  }
}

}  // namespace rigcal::server

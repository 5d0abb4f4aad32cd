// SPDX-License-Identifier: Apache-2.0
#include "server/estimate/estimate_loop.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/guarded.h"
#include "server/session/utc_clock.h"

namespace rigcal::server {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kLookInterval{100};

float Millimetres(double metres) { return static_cast<float>(1e3 * metres); }

LiveVolume VolumeOf(const RunningEstimate& estimate) {
  LiveVolume volume;
  volume.origin_m = estimate.grid.origin_m;
  volume.step_m = estimate.grid.step_m;
  volume.count_x = static_cast<uint32_t>(estimate.grid.counts[0]);
  volume.count_y = static_cast<uint32_t>(estimate.grid.counts[1]);
  volume.count_z = static_cast<uint32_t>(estimate.grid.counts[2]);
  volume.wand_counts = estimate.grid.wand_counts;
  volume.sigma_mm.assign(estimate.grid.size(), 0);
  for (size_t i = 0; i < estimate.error.points.size(); ++i) {
    volume.sigma_mm[estimate.error.points[i]] = Millimetres(estimate.error.sigma_m[i]);
  }
  volume.median_mm = 1e3 * estimate.error.median_m;
  volume.p95_mm = 1e3 * estimate.error.p95_m;
  volume.worst_mm = 1e3 * estimate.error.worst_m;
  if (!estimate.error.points.empty()) {
    volume.worst_point_m = estimate.grid.Point(estimate.error.worst_point);
  }
  volume.scale_sigma_rel = estimate.scale_sigma_rel;
  return volume;
}

// What stays where an attempt gives nothing: the figures of the last good one.
void Show(const RunningOutcome& outcome, const Session& session, size_t max_history,
          LiveEstimate* live) {
  live->session_id = session.id;
  live->needs.clear();
  for (const PairNeed& need : outcome.needs) {
    live->needs.push_back({need.camera_a, need.camera_b, static_cast<uint32_t>(need.common_count),
                           static_cast<uint32_t>(need.needed_count)});
  }
  live->problem = std::string(outcome.problem.message());
  if (!outcome.estimate) {
    live->state = outcome.problem.ok() ? EstimateState::kWaiting : EstimateState::kFailed;
    return;
  }
  const RunningEstimate& estimate = *outcome.estimate;
  live->state = EstimateState::kReady;
  live->time_utc_ns = UtcNowNs({});
  live->instant_count = static_cast<uint32_t>(estimate.instant_count);
  live->scale_known = estimate.scale_known;
  live->intrinsics_refined = estimate.intrinsics_refined;
  live->cameras.clear();
  for (const EstimatedCamera& camera : estimate.cameras) {
    live->cameras.push_back({camera.name, camera.cam_from_rig, camera.time_offset_s,
                             camera.time_offset_sigma_s, camera.reprojection_rms_px,
                             camera.focal_length_px, camera.lens_disagrees});
  }
  live->marker_positions_m = estimate.marker_positions_m;
  live->volume = VolumeOf(estimate);
  live->history.push_back(
      {1e-9 * static_cast<double>(live->time_utc_ns - session.start_utc_ns), live->volume->p95_mm});
  if (live->history.size() > max_history) {
    // Every second one: the curve keeps its length in time.
    std::vector<LiveFigure> half;
    for (size_t i = 0; i < live->history.size(); i += 2) half.push_back(live->history[i]);
    live->history = std::move(half);
  }
  live->held_out.reset();
  if (estimate.held_out) {
    live->held_out = LiveHeldOut{estimate.held_out->rms_px, estimate.held_out->expected_rms_px,
                                 estimate.held_out->agrees};
  }
  live->advice.clear();
  for (const WaveAdvice& advice : estimate.advice) {
    live->advice.push_back(
        {advice.text, advice.point_m, advice.cameras, 1e3 * advice.expected_p95_m});
  }
  live->wand_m = estimate.wand_m;
}

}  // namespace

EstimateLoop::EstimateLoop(EstimateLoopOptions options, const Store* store,
                           EstimateFunction estimate, std::function<void(LiveEstimate)> show)
    : options_(options), store_(store), estimate_(std::move(estimate)), show_(std::move(show)) {}

EstimateLoop::~EstimateLoop() { Shutdown(); }

void EstimateLoop::Start() {
  thread_ = std::thread([this] { Run(); });
}

void EstimateLoop::Shutdown() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  if (thread_.joinable()) thread_.join();
}

bool EstimateLoop::WaitUntil(Time time) {
  std::unique_lock lock(mutex_);
  return !wake_.wait_until(lock, time, [this] { return stopping_.load(); });
}

void EstimateLoop::Run() {
  while (WaitUntil(std::chrono::steady_clock::now() + kLookInterval)) {
    const absl::Status round = Guarded("the running estimate", [this] {
      for (const std::string& id : rows_.Sessions()) {
        if (stopping_) return;
        const Time now = std::chrono::steady_clock::now();
        if (now < progress_[id].next || (waits_ && waits_(id))) continue;
        progress_[id].next = now + options_.max_age;  // also where it fails
        const absl::Status status =
            Guarded(absl::StrCat("session ", id), [&] { EstimateSession(id); });
        if (!status.ok()) ShowFault(id, status);
      }
    });
    if (round.ok()) continue;
    spdlog::error("{}; it is tried again", std::string(round.message()));
    WaitUntil(std::chrono::steady_clock::now() + options_.max_age);
  }
}

void EstimateLoop::ShowFault(const std::string& id, const absl::Status& fault) {
  spdlog::error(
      "{}; the running estimate is tried again, and recording goes on: if this is repeated, look "
      "at "
      "the memory of this PC",
      std::string(fault.message()));
  Progress& progress = progress_[id];
  progress.shown.session_id = id;
  progress.shown.state = EstimateState::kFailed;
  progress.shown.problem = std::string(fault.message());
  show_(progress.shown);
}

void EstimateLoop::EstimateSession(const std::string& id) {
  const auto begin = std::chrono::steady_clock::now();
  const absl::StatusOr<Session> session = store_->GetSession(id);
  // Of any other error of the store nothing follows: it is asked again.
  if (!session.ok() && !absl::IsNotFound(session.status())) {
    const std::string problem(session.status().message());
    if (std::exchange(progress_[id].store_problem, problem) == problem) return;
    spdlog::warn("session {}: no running estimate now, tried again: {}", id, problem);
    return;
  }
  if (!session.ok() || session->state == SessionState::kFinished) {
    // The last estimate stays where it is shown.
    rows_.Forget(id);
    progress_.erase(id);
    return;
  }
  Progress& progress = progress_[id];
  progress.store_problem.clear();
  std::optional<RowCollection::Snapshot> snapshot = rows_.Take(id);
  if (!snapshot || snapshot->seen_count == progress.seen_count) return;
  progress.seen_count = snapshot->seen_count;
  EstimateTask task;
  task.target = session->target;
  for (RowCollection::Track& rows : snapshot->tracks) {
    const SessionCamera* const camera = session->FindCamera(rows.camera);
    if (camera == nullptr) continue;
    CameraTrack track;
    track.session_id = rows.session_id;
    track.camera = rows.description.value_or(camera->description);
    task.tracks.push_back(std::move(track));
    task.rows.push_back(std::move(rows.rows));
  }
  task.data_share = snapshot->data_share;
  task.start = progress.start;
  absl::StatusOr<RunningOutcome> outcome = estimate_(std::move(task), stopping_);
  if (stopping_) return;
  if (!outcome.ok()) {
    spdlog::warn("session {}: no running estimate: {}", id,
                 std::string(outcome.status().message()));
    outcome = RunningOutcome{.estimate = std::nullopt, .problem = outcome.status(), .needs = {}};
  }
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  progress.shown.solve_duration_s = took.count();
  progress.next =
      begin + std::max(options_.max_age - std::chrono::duration_cast<milliseconds>(took),
                       options_.max_age / 2);
  Show(*outcome, *session, options_.max_history, &progress.shown);
  if (outcome->estimate) progress.start = std::move(outcome->estimate->next);
  show_(progress.shown);
}

}  // namespace rigcal::server

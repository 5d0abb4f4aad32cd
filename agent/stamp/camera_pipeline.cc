// SPDX-License-Identifier: Apache-2.0
#include "agent/stamp/camera_pipeline.h"

#include <spdlog/spdlog.h>

#include <chrono>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/guarded.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

// A full batch is worth waking the uplink for; fewer rows wait for its own timer.
constexpr uint32_t kRowsPerProgress = 256;
constexpr std::chrono::seconds kReportInterval{1};

}  // namespace

void CameraPipeline::Shutdown() {
  EndAll();
  {
    const std::lock_guard lock(mutex_);
    shut_down_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

absl::Status CameraPipeline::Begin(const StreamKey& stream, const Target& target,
                                   uint32_t first_seq) {
  const std::lock_guard lock(mutex_);
  if (shut_down_) return absl::CancelledError("the agent shuts down");
  RIGCAL_RETURN_IF_ERROR(spool_->Open(stream, target.marker_count(), first_seq));
  if (!captures_.empty()) {
    spdlog::info("camera {}: the capture for session {} waits until that for session {} has ended",
                 stream.camera, stream.session_id, captures_.front().stream.session_id);
  }
  captures_.push_back({.stream = stream, .target = target});
  changed_.notify_all();
  return absl::OkStatus();
}

void CameraPipeline::End(const std::string& session_id) {
  EndIf([&](const Capture& capture) { return capture.stream.session_id == session_id; });
}

void CameraPipeline::EndAll() {
  EndIf([](const Capture&) { return true; });
}

void CameraPipeline::EndIf(const std::function<bool(const Capture&)>& condition) {
  const std::lock_guard lock(mutex_);
  for (auto capture = captures_.begin(); capture != captures_.end();) {
    const bool runs = running_ && capture == captures_.begin();
    if (!condition(*capture)) {
      ++capture;
    } else if (runs) {
      capture->stop = true;
      source_->Stop();
      ++capture;
    } else {
      // Fails only for a stream that was discarded, of which nobody awaits the end.
      spool_->Finish(capture->stream, {}).IgnoreError();
      capture = captures_.erase(capture);
      on_progress_();
    }
  }
  changed_.notify_all();
}

std::vector<std::string> CameraPipeline::Sessions() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::string> sessions;
  for (const Capture& capture : captures_) {
    if (!capture.stop) sessions.push_back(capture.stream.session_id);
  }
  return sessions;
}

std::optional<CameraReport> CameraPipeline::RunningReport() const {
  const std::lock_guard lock(mutex_);
  if (!running_) return std::nullopt;
  return report_;
}

void CameraPipeline::WaitUntilIdle() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return captures_.empty(); });
}

void CameraPipeline::Run() {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return shut_down_ || !captures_.empty(); });
    if (captures_.empty()) return;
    running_ = true;
    const StreamKey stream = captures_.front().stream;
    const Target target = captures_.front().target;
    report_ = {};
    report_.stream = stream;
    lock.unlock();
    const absl::Status fault = Guarded("ending a capture", [&] { RunCapture(stream, target); });
    if (!fault.ok()) {
      spdlog::error("camera {}: session {}: {}; the next capture begins all the same",
                    stream.camera, stream.session_id, std::string(fault.message()));
      // Without its end the session would wait for it.
      Guarded("ending a capture", [&] { return spool_->Finish(stream, {}); }).IgnoreError();
    }
    lock.lock();
    running_ = false;
    captures_.pop_front();
    changed_.notify_all();
  }
}

void CameraPipeline::RunCapture(const StreamKey& stream, const Target& target) {
  spdlog::info("camera {}: capture for session {} begins", stream.camera, stream.session_id);
  absl::Status status;
  CameraReport report;
  RefusalReason reason = RefusalReason::kSourceFailed;
  if (!StopRequested()) {
    status =
        Guarded("the source failed", [&] { return MoveObservations(stream, target, &reason); });
    // What it had counted holds, whatever has ended it.
    const absl::Status counted = Guarded("counts of the source", [&] { report = MakeReport(); });
    if (!counted.ok()) {
      const std::lock_guard lock(mutex_);
      report = report_;  // at most a second old
    }
  }
  if (!status.ok()) {
    const std::string message(status.message());
    spdlog::error("camera {}: capture for session {} ends early: {}", stream.camera,
                  stream.session_id, message);
    report.refused.push_back({.camera = "", .reason = reason, .count = 1, .example = message});
  }
  for (const Refusal& refusal : report.refused) {
    spdlog::warn("camera {}: {} x {}, first: {}", stream.camera, NameOf(refusal.reason),
                 refusal.count, refusal.example);
  }
  if (spool_->Finish(stream, std::move(report)).ok()) {
    spdlog::info("camera {}: capture for session {} has ended", stream.camera, stream.session_id);
  }
  on_progress_();
}

absl::Status CameraPipeline::MoveObservations(const StreamKey& stream, const Target& target,
                                              RefusalReason* reason) {
  RIGCAL_RETURN_IF_ERROR(source_->Start(target));
  // An End between the check above and Start was undone by Start.
  if (StopRequested()) source_->Stop();
  uint32_t count = 0;
  auto next_report = std::chrono::steady_clock::now() + kReportInterval;
  while (true) {
    RIGCAL_ASSIGN_OR_RETURN(const std::optional<Observation> observation, source_->Next());
    if (!observation) return absl::OkStatus();
    const absl::StatusOr<uint32_t> seq =
        spool_->Append(stream, *observation, source_->TakeClockSamples());
    // The stream was discarded, which is logged where that is decided, or the agent shuts down.
    if (absl::IsNotFound(seq.status()) || absl::IsCancelled(seq.status())) return absl::OkStatus();
    if (absl::IsDataLoss(seq.status())) *reason = RefusalReason::kSpoolFailed;
    RIGCAL_RETURN_IF_ERROR(seq.status());
    if (++count % kRowsPerProgress == 0) on_progress_();
    if (const auto now = std::chrono::steady_clock::now(); now >= next_report) {
      next_report = now + kReportInterval;
      CameraReport report = MakeReport();
      report.stream = stream;
      report.observation_count = count;
      const std::lock_guard lock(mutex_);
      report_ = std::move(report);
    }
  }
}

bool CameraPipeline::StopRequested() const {
  const std::lock_guard lock(mutex_);
  return captures_.front().stop;
}

CameraReport CameraPipeline::MakeReport() const {
  CameraReport report;
  report.refused = source_->Refused();
  report.frames = source_->frame_counts();
  report.detections = source_->detection_counts();
  return report;
}

absl::StatusOr<CameraPipelines> MakePipelines(
    std::vector<std::unique_ptr<ObservationSource>> sources, ObservationSpool* spool,
    const std::function<void()>& on_progress) {
  CameraPipelines pipelines;
  for (std::unique_ptr<ObservationSource>& source : sources) {
    const std::string name = source->description().camera;
    if (!pipelines
             .try_emplace(name,
                          std::make_unique<CameraPipeline>(std::move(source), spool, on_progress))
             .second) {
      return absl::InvalidArgumentError(
          absl::StrCat("two cameras are named ", name,
                       ": give each source a name, NAME=csv:... or NAME=sim:..."));
    }
  }
  return pipelines;
}

}  // namespace rigcal::agent

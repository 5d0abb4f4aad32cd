// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <spdlog/spdlog.h>

#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "agent/capture/observation_source.h"

namespace rigcal::agent {

// Created before any thread: spdlog is not built with the thread sanitizer, which would report the
// first logging of two threads as a race.
inline spdlog::logger* const kLoggerMadeEarly = spdlog::default_logger_raw();

inline Observation MakeObservation(int64_t time_ns, uint32_t clock_epoch = 0,
                                   size_t marker_count = 1) {
  Observation observation;
  observation.time_ns = time_ns;
  observation.clock_epoch = clock_epoch;
  for (size_t marker = 0; marker < marker_count; ++marker) {
    MarkerObservation seen;
    seen.visible = true;
    seen.centre_px = {static_cast<double>(time_ns % 1000), static_cast<double>(marker)};
    observation.markers.push_back(seen);
  }
  return observation;
}

inline Target MakeTarget() {
  Target target;
  target.kind = TargetKind::kWand;
  target.marker_positions_m = {0, 0.3};
  return target;
}

// A camera that yields what a test gives it, when the test gives it, and counts its starts.
class ScriptedSource : public ObservationSource {
 public:
  explicit ScriptedSource(std::string camera, std::string timebase = "recording") {
    description_.camera = camera;
    description_.image_size_px = {1280, 1024};
    description_.clock = {std::move(camera), std::move(timebase)};
  }

  const CameraDescription& description() const override { return description_; }

  absl::Status Start(const Target& target) override {
    const std::lock_guard lock(mutex_);
    ++starts_;
    target_ = target;
    stopped_ = false;
    changed_.notify_all();
    return start_status_;
  }
  absl::StatusOr<std::optional<Observation>> Next() override {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return stopped_ || !script_.empty(); });
    if (stopped_) return std::nullopt;
    absl::StatusOr<std::optional<Observation>> next = std::move(script_.front());
    script_.pop_front();
    return next;
  }
  void Stop() override {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
    changed_.notify_all();
  }
  std::vector<ClockSample> TakeClockSamples() override {
    const std::lock_guard lock(mutex_);
    return std::exchange(clock_samples_, {});
  }
  std::vector<Refusal> Refused() const override {
    const std::lock_guard lock(mutex_);
    return refused_;
  }

  // For tests, from any thread.
  void Yield(Observation observation) { Push(std::optional<Observation>(std::move(observation))); }
  void YieldRows(int first, int count) {
    for (int row = first; row < first + count; ++row) Yield(MakeObservation(row * 1000, 0, 2));
  }
  void YieldEnd() { Push(std::optional<Observation>()); }
  void YieldError(absl::Status status) { Push(std::move(status)); }
  void FailToStart(absl::Status status) {
    const std::lock_guard lock(mutex_);
    start_status_ = std::move(status);
  }
  void SetRefused(std::vector<Refusal> refused) {
    const std::lock_guard lock(mutex_);
    refused_ = std::move(refused);
  }
  void AddClockSample(const ClockSample& sample) {
    const std::lock_guard lock(mutex_);
    clock_samples_.push_back(sample);
  }
  void WaitUntilStarted(int times) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return starts_ >= times; });
  }
  int starts() const {
    const std::lock_guard lock(mutex_);
    return starts_;
  }
  Target target() const {
    const std::lock_guard lock(mutex_);
    return target_;
  }

 private:
  void Push(absl::StatusOr<std::optional<Observation>> next) {
    const std::lock_guard lock(mutex_);
    script_.push_back(std::move(next));
    changed_.notify_all();
  }

  CameraDescription description_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<absl::StatusOr<std::optional<Observation>>> script_;
  std::vector<ClockSample> clock_samples_;
  std::vector<Refusal> refused_;
  absl::Status start_status_;
  Target target_;
  bool stopped_ = true;
  int starts_ = 0;
};

}  // namespace rigcal::agent

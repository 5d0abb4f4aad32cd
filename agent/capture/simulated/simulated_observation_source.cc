// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/simulated/simulated_observation_source.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/capture/simulated/simulated_camera.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {

absl::Status SimulatedSourceOptions::Validate() const { return Check({}); }

absl::StatusOr<std::unique_ptr<SimulatedObservationSource>> SimulatedObservationSource::Create(
    SimulatedSourceOptions options) {
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  RIGCAL_ASSIGN_OR_RETURN(CameraDescription description, DescribeSimulatedCamera(options));
  return std::unique_ptr<SimulatedObservationSource>(
      new SimulatedObservationSource(std::move(options), std::move(description)));
}

SimulatedObservationSource::SimulatedObservationSource(SimulatedSourceOptions options,
                                                       CameraDescription description)
    : options_(std::move(options)), description_(std::move(description)), pacer_(options_.speed) {}

absl::Status SimulatedObservationSource::Start(const Target& target) {
  RIGCAL_ASSIGN_OR_RETURN(world_, SharedWorld(options_.simulation, target));
  const double rate_hz = world_->cameras()[static_cast<size_t>(options_.camera_index)].rate_hz;
  frames_per_sample_ = std::max(1, static_cast<int>(std::lround(rate_hz)));
  frame_ = 0;
  clock_epochs_ = {};
  clock_samples_.clear();
  pacer_.Start();
  return absl::OkStatus();
}

absl::StatusOr<std::optional<Observation>> SimulatedObservationSource::Next() {
  if (world_ == nullptr || frame_ >= world_->FrameCount(options_.camera_index)) return std::nullopt;
  Observation observation = world_->Observe(options_.camera_index, frame_);
  observation.clock_epoch = clock_epochs_.EpochOf(observation.time_ns);
  if (!pacer_.Wait(observation.time_ns)) return std::nullopt;
  if (options_.simulation.clock_samples && frame_ % frames_per_sample_ == 0) {
    clock_samples_.push_back(world_->SampleClock(options_.camera_index, frame_));
  }
  ++frame_;
  return observation;
}

std::vector<ClockSample> SimulatedObservationSource::TakeClockSamples() {
  return std::exchange(clock_samples_, {});
}

}  // namespace rigcal::agent

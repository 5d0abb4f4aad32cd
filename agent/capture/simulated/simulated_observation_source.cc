// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/simulated/simulated_observation_source.h"

#include <utility>

namespace rigcal::agent {

absl::StatusOr<std::unique_ptr<SimulatedObservationSource>> SimulatedObservationSource::Create(
    SimulatedCameraOptions options) {
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  RIGCAL_ASSIGN_OR_RETURN(CameraDescription description, DescribeSimulatedCamera(options));
  return std::make_unique<SimulatedObservationSource>(std::move(options), std::move(description));
}

absl::StatusOr<std::optional<Observation>> SimulatedObservationSource::Next() {
  if (!HasFrame()) return std::nullopt;
  Observation observation = world_->Observe(options_.camera_index, frame_);
  observation.clock_epoch = clock_epochs_.EpochOf(observation.time_ns);
  if (!PassFrame(observation.time_ns)) return std::nullopt;
  return observation;
}

}  // namespace rigcal::agent

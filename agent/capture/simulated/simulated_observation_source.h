// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <utility>

#include "absl/status/statusor.h"
#include "agent/capture/observation_source.h"
#include "agent/capture/simulated/simulated_camera.h"

namespace rigcal::agent {

// One camera of a simulated world: synthetic observations of the session's target. With
// `clock_samples` its clock counts from an origin of its own and is sampled once per second.
// Cameras of one process with equal options share one world.
class SimulatedObservationSource
    : public SimulatedSource<ObservationSource, SimulatedCameraOptions> {
 public:
  using SimulatedSource::SimulatedSource;
  static absl::StatusOr<std::unique_ptr<SimulatedObservationSource>> Create(
      SimulatedCameraOptions options) {
    RIGCAL_RETURN_IF_ERROR(options.Validate());
    RIGCAL_ASSIGN_OR_RETURN(CameraDescription description, DescribeSimulatedCamera(options));
    RIGCAL_RETURN_IF_ERROR(DescribeLens(options, &description));
    return std::make_unique<SimulatedObservationSource>(std::move(options), std::move(description));
  }

  absl::Status Start(const Target& target) override { return StartWorld(target); }
  absl::StatusOr<std::optional<Observation>> Next() override {
    if (!HasFrame()) return std::nullopt;
    Observation observation = world_->Observe(options_.camera_index, frame_);
    observation.clock_epoch = clock_epochs_.EpochOf(observation.time_ns);
    if (!PassFrame(observation.time_ns)) return std::nullopt;
    return observation;
  }
};

}  // namespace rigcal::agent

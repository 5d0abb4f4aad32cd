// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>

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
      SimulatedCameraOptions options);

  absl::Status Start(const Target& target) override { return StartWorld(target); }
  absl::StatusOr<std::optional<Observation>> Next() override;
};

}  // namespace rigcal::agent

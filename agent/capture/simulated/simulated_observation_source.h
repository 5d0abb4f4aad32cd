// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "agent/capture/observation_source.h"
#include "agent/capture/pacer.h"
#include "agent/capture/simulated/simulated_camera.h"
#include "common/simulation/world/simulated_world.h"
#include "common/time/clock.h"

namespace rigcal::agent {

struct SimulatedSourceOptions : SimulatedCameraOptions {
  // INVALID_ARGUMENT with every fault.
  absl::Status Validate() const;
};

// One camera of a simulated world: synthetic observations of the session's target. With
// `clock_samples` its clock counts from an origin of its own and is sampled once per second.
// Cameras of one process with equal options share one world.
class SimulatedObservationSource : public ObservationSource {
 public:
  static absl::StatusOr<std::unique_ptr<SimulatedObservationSource>> Create(
      SimulatedSourceOptions options);

  const CameraDescription& description() const override { return description_; }
  // INVALID_ARGUMENT: the world cannot show this target.
  absl::Status Start(const Target& target) override;
  absl::StatusOr<std::optional<Observation>> Next() override;
  void Stop() override { pacer_.Stop(); }
  std::vector<ClockSample> TakeClockSamples() override;

 private:
  SimulatedObservationSource(SimulatedSourceOptions options, CameraDescription description);

  const SimulatedSourceOptions options_;
  const CameraDescription description_;
  Pacer pacer_;
  std::shared_ptr<const SimulatedWorld> world_;
  int frame_ = 0;               // the next one
  int frames_per_sample_ = 25;  // once per second
  ClockEpochCounter clock_epochs_;
  std::vector<ClockSample> clock_samples_;
};

}  // namespace rigcal::agent

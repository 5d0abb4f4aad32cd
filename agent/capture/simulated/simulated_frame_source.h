// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/capture/frame_source.h"
#include "agent/capture/simulated/simulated_camera.h"
#include "common/simulation/frames/frame_renderer.h"

namespace rigcal::agent {

struct SimulatedFrameSourceOptions : SimulatedCameraOptions {
  FrameRenderOptions rendering;  // light, lens and sensor

  // INVALID_ARGUMENT with every fault.
  absl::Status Validate() const {
    FaultList faults;
    faults.Add(rendering.Validate());
    return SimulatedCameraOptions::Validate(std::move(faults));
  }
};

void AddOptions(SimulatedFrameSourceOptions* options, OptionTable* table);

// The frames of one camera of a simulated world, rendered on request, with the timestamps
// and clocks that SimulatedObservationSource gives its observations.
class SimulatedFrameSource : public SimulatedSource<FrameSource, SimulatedFrameSourceOptions> {
 public:
  using SimulatedSource::SimulatedSource;
  static absl::StatusOr<std::unique_ptr<SimulatedFrameSource>> Create(
      SimulatedFrameSourceOptions options);

  absl::Status Start(const Target& target) override;
  absl::StatusOr<std::optional<Frame>> Next() override;
  FrameCounts counts() const override { return counts_; }

 private:
  std::optional<FrameRenderer> renderer_;
  std::vector<uint8_t> bgr_;  // what the frame yielded last shows
  FrameCounts counts_;
};

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "agent/capture/frame_source.h"
#include "agent/capture/pacer.h"
#include "agent/capture/simulated/simulated_camera.h"
#include "common/simulation/frames/frame_renderer.h"
#include "common/simulation/world/simulated_world.h"
#include "common/time/clock.h"

namespace rigcal::agent {

struct SimulatedFrameSourceOptions : SimulatedCameraOptions {
  FrameRenderOptions rendering;  // light, lens and sensor

  // INVALID_ARGUMENT with every fault.
  absl::Status Validate() const;
};

void AddOptions(SimulatedFrameSourceOptions* options, OptionTable* table);

// The frames of one camera of a simulated world, rendered on request, with the timestamps
// and clocks that SimulatedObservationSource gives its observations.
class SimulatedFrameSource : public FrameSource {
 public:
  static absl::StatusOr<std::unique_ptr<SimulatedFrameSource>> Create(
      SimulatedFrameSourceOptions options);

  const CameraDescription& description() const override { return description_; }
  // INVALID_ARGUMENT: the world cannot show this target.
  absl::Status Start(const Target& target) override;
  absl::StatusOr<std::optional<Frame>> Next() override;
  void Stop() override { pacer_.Stop(); }
  std::vector<ClockSample> TakeClockSamples() override;
  FrameCounts counts() const override { return counts_; }

 private:
  SimulatedFrameSource(SimulatedFrameSourceOptions options, CameraDescription description);

  const SimulatedFrameSourceOptions options_;
  const CameraDescription description_;
  Pacer pacer_;
  std::shared_ptr<const SimulatedWorld> world_;
  std::optional<FrameRenderer> renderer_;
  std::vector<uint8_t> bgr_;    // what the frame yielded last shows
  int frame_ = 0;               // the next one
  int frames_per_sample_ = 25;  // once per second
  ClockEpochCounter clock_epochs_;
  std::vector<ClockSample> clock_samples_;
  FrameCounts counts_;
};

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/capture/frame_source.h"
#include "agent/capture/simulated/simulated_camera.h"
#include "common/board/board.h"
#include "common/simulation/frames/board_renderer.h"
#include "common/simulation/frames/frame_renderer.h"

namespace rigcal::agent {

struct SimulatedFrameSourceOptions : SimulatedCameraOptions {
  FrameRenderOptions rendering;  // light, lens and sensor
  bool held_before = false;      // a board is held right before this camera, as for its lens

  // INVALID_ARGUMENT with every fault.
  absl::Status Validate() const {
    FaultList faults;
    faults.Add(rendering.Validate());
    return SimulatedCameraOptions::Validate(std::move(faults));
  }
};

void AddOptions(SimulatedFrameSourceOptions* options, OptionTable* table);

// The frames of one camera of a simulated world, rendered on request, with the timestamps
// and clocks that SimulatedObservationSource gives its observations. The target is a wand, a point,
// or a printed board.
class SimulatedFrameSource : public SimulatedSource<FrameSource, SimulatedFrameSourceOptions> {
 public:
  using SimulatedSource::SimulatedSource;
  static absl::StatusOr<std::unique_ptr<SimulatedFrameSource>> Create(
      SimulatedFrameSourceOptions options);

  absl::Status Start(const Target& target) override;
  absl::StatusOr<std::optional<Frame>> Next() override;
  FrameCounts counts() const override { return counts_; }

 private:
  void RenderBoard();  // the next frame, to bgr_

  std::optional<FrameRenderer> renderer_;  // of the wand
  std::optional<BoardRenderer> board_renderer_;
  Board board_;
  std::vector<uint8_t> bgr_;  // what the frame yielded last shows
  FrameCounts counts_;
};

}  // namespace rigcal::agent

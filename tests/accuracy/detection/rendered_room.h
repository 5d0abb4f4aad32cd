// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/detect/blobs/image_view.h"
#include "common/simulation/frames/scene_renderer.h"
#include "tests/accuracy/detection/detection_options.h"

namespace rigcal::accuracy {

// What a frame shows; its pixels are those of the room until the next frame.
struct RoomFrame {
  uint64_t seed = 0;
  std::optional<WandMotion> wand;  // none: the room alone
  FrameGroundTruth truth;
  // By the wand's LEDs, which add at least half of the room's light to it. With one clock for all
  // LEDs a short exposure may fall into the dark.
  bool lit = true;
};

// The frames of one room. Follows from options.seed and the number of the room alone.
class RenderedRoom {
 public:
  // Errors of SceneRenderer::Create.
  static absl::StatusOr<RenderedRoom> Create(const DetectionOptions& options, int room);

  // Errors of SceneRenderer::Render.
  absl::StatusOr<RoomFrame> Render(int frame);
  agent::ImageView view() const;

 private:
  RenderedRoom(const DetectionOptions& options, SceneRenderer renderer, uint32_t seed)
      : options_(options), renderer_(std::move(renderer)), seed_(seed) {
    pixels_.resize(renderer_.buffer_size());
  }

  DetectionOptions options_;
  SceneRenderer renderer_;
  uint32_t seed_;
  std::vector<uint8_t> pixels_;
};

}  // namespace rigcal::accuracy

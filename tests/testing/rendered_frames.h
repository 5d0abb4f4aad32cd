// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "common/camera/camera_export.h"
#include "common/simulation/frames/frame_renderer.h"
#include "common/simulation/world/simulated_world.h"
#include "common/target/target.h"

namespace rigcal::testing {

struct RenderedFramesOptions {
  SimulationOptions simulation;
  FrameRenderOptions rendering;
  Target target;
  int camera_index = 0;
  std::string pixel_format = "BayerRG8";  // Mono8, BayerRG8 (GR, GB, BG), RGB8
  int threads = 2;                        // rendering threads
  int ahead = 50;                         // frames rendered before they are due
};

// The frames of one camera of a simulated world as a GenICam camera sends them, rendered ahead by
// threads of their own. A frame that is not ready when it is due is sent black and counted; after
// the last one every frame is black.
class RenderedFrames {
 public:
  // Renders the first `ahead` frames before it returns.
  static absl::StatusOr<std::unique_ptr<RenderedFrames>> Create(RenderedFramesOptions options);
  ~RenderedFrames();
  RenderedFrames(const RenderedFrames&) = delete;
  RenderedFrames& operator=(const RenderedFrames&) = delete;

  ImageSize image_size_px() const { return camera().description.image_size_px; }
  double rate_hz() const { return camera().rate_hz; }
  // The camera's intrinsics and true pose, for an agent's calibration file.
  CameraExport Export(const std::string& name) const;

  // Frame `index` in the wire's format. Returns the start of its exposure on the device's clock,
  // ns, for the exposure that the client has set; the middle is that of the rendered frame. Indices
  // must increase; for one thread.
  int64_t Take(uint64_t index, double exposure_s, std::span<uint8_t> pixels);
  // The frame of this instant, the first one at the first call. After late or rare calls frames are
  // skipped, so that the device's clock keeps pace with the host's.
  int64_t TakeNow(double exposure_s, std::span<uint8_t> pixels);
  // Frames sent black because they were not ready.
  uint64_t late() const;

 private:
  explicit RenderedFrames(RenderedFramesOptions options) : options_(std::move(options)) {}
  const SimulatedCamera& camera() const {
    return world_->cameras()[static_cast<size_t>(options_.camera_index)];
  }
  void Render(FrameRenderer renderer);  // run by each thread

  const RenderedFramesOptions options_;
  std::shared_ptr<const SimulatedWorld> world_;
  uint64_t frame_count_ = 0;
  std::optional<std::chrono::steady_clock::time_point> began_;
  uint64_t next_now_ = 0;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  bool ending_ = false;
  uint64_t next_render_ = 0;
  uint64_t next_due_ = 0;
  uint64_t late_ = 0;
  std::map<uint64_t, std::vector<uint8_t>> ready_;  // by index, in the wire's format
  std::vector<std::thread> threads_;
};

// BGR, rows without padding, as one of RenderedFramesOptions' formats.
void EncodeImage(const std::string& pixel_format, std::span<const uint8_t> bgr, int width,
                 std::span<uint8_t> pixels);

}  // namespace rigcal::testing

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/detect/blobs/image_view.h"
#include "common/camera/camera_description.h"
#include "common/camera/frame_counts.h"
#include "common/status/refusal.h"
#include "common/target/target.h"
#include "common/time/clock.h"

namespace rigcal::agent {

// Valid until the source's next Next, Start or its end.
struct Frame {
  ImageView image;
  int64_t time_ns = 0;  // the camera's clock, the middle of the exposure
  uint32_t clock_epoch = 0;
  double exposure_s = 0;  // 0: not known
  std::string file = {};  // the image file it was read from; empty: it has none of its own
};

// One camera's frames in capture order. Start, Next, TakeClockSamples and the getters are called
// by one thread; Stop by any.
class FrameSource {
 public:
  virtual ~FrameSource() = default;

  // Valid from construction on, never changes.
  virtual const CameraDescription& description() const = 0;

  // Begins a capture, from the beginning where there is one. The target is what the world of a
  // simulated camera shows; the others ignore it.
  virtual absl::Status Start(const Target& target) = 0;

  // The next complete frame; waits for it. None: the source has ended or was stopped. A damaged
  // frame is counted and skipped. An error ends the capture.
  virtual absl::StatusOr<std::optional<Frame>> Next() = 0;

  // Makes a waiting and every later Next return none, until the next Start.
  virtual void Stop() = 0;

  // Readings of the camera's clock since the last call.
  virtual std::vector<ClockSample> TakeClockSamples() { return {}; }
  // Since Start.
  virtual FrameCounts counts() const = 0;
  // Since Start, by reason. `camera` is left empty.
  virtual std::vector<Refusal> Refused() const { return {}; }
};

}  // namespace rigcal::agent

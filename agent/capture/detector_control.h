// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <mutex>
#include <optional>
#include <utility>

#include "agent/capture/preview/preview_tap.h"
#include "agent/detect/blobs/pixel_mask.h"
#include "common/camera/camera_description.h"
#include "common/target/colour_range.h"
#include "common/target/target.h"

namespace rigcal::agent {

// A pixel of either mask. Of masks of two sizes the first; one without pixels is none.
PixelMask Union(PixelMask a, const PixelMask& b);

// What the detector of one camera looks for and ignores, changed while it runs, and its frames to
// learn from. The configuration is the beginning; what is set here replaces its colour and adds to
// its mask. Any thread, unless it says otherwise.
class DetectorControl {
 public:
  DetectorControl(CameraDescription camera, const ColourRange& colour, PixelMask mask)
      : camera_(std::move(camera)), configured_colour_(colour), configured_mask_(std::move(mask)) {}
  DetectorControl(const DetectorControl&) = delete;
  DetectorControl& operator=(const DetectorControl&) = delete;

  const CameraDescription& camera() const { return camera_; }
  ColourRange colour() const;
  std::optional<ColourRange> learnt_colour() const;
  PixelMask ignored() const;      // by either mask
  PixelMask learnt_mask() const;  // without pixels: none

  // From the next frame on. `colour` is valid; none: that of the configuration.
  void SetColour(const std::optional<ColourRange>& colour);
  // `mask` has the size of the camera's images; without pixels: none.
  void SetMask(PixelMask mask);

  // Frames for learning; those for people have a tap of their own.
  PreviewTap& frames() { return frames_; }
  // Of the capture that runs. None: there is none, and no frame comes.
  std::optional<Target> target() const;

  // For the capturing thread.
  void SetTarget(std::optional<Target> target);
  // Something was set since the last call.
  bool TakeChange() { return changed_.load(std::memory_order_relaxed) && changed_.exchange(false); }

 private:
  const CameraDescription camera_;
  const ColourRange configured_colour_;
  const PixelMask configured_mask_;
  PreviewTap frames_;

  mutable std::mutex mutex_;
  std::optional<ColourRange> colour_;
  PixelMask mask_;
  std::optional<Target> target_;
  std::atomic<bool> changed_{false};
};

}  // namespace rigcal::agent

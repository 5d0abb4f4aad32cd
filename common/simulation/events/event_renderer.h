// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/camera/intrinsics.h"
#include "common/simulation/events/event_readout.h"
#include "common/simulation/events/event_render_options.h"
#include "common/simulation/events/event_spheres.h"
#include "common/simulation/frames/frame_render_options.h"
#include "common/simulation/frames/scene_renderer.h"
#include "common/target/target.h"

namespace rigcal {

// An edge at the sensor's trigger input.
struct SimulatedTrigger {
  int64_t time_us = 0;
  bool rising = false;
};

// The view of one event camera of the world of SceneRenderer: the same room, lens, spheres and
// LEDs. Pixels near a sphere, a moving edge or a lamp are followed through their low pass; all
// others only make noise. Deterministic: equal arguments give equal events, however the time is cut
// into slices. One thread at a time.
class EventRenderer {
 public:
  // Pixels are followed by cells, cut so that spheres and edges move by at most 0.35 px and lamps
  // go on by a sixteenth of their period in a part, within which ln(light) is taken as linear.
  static constexpr int64_t kCellUs = 1000;

  // `scene`: light, lens blur, room and LEDs (exposure and sensor noise are not used but for the
  // scale of light); markers blink at the target's frequencies, or the scene's where it has none.
  // INVALID_ARGUMENT: intrinsics, image size (sides up to 2048), target or options not valid.
  static absl::StatusOr<EventRenderer> Create(const Intrinsics& intrinsics,
                                              const ImageSize& image_size, const Target& target,
                                              const FrameRenderOptions& scene,
                                              const EventRenderOptions& options);
  EventRenderer(EventRenderer&&) noexcept;
  EventRenderer& operator=(EventRenderer&&) noexcept;
  ~EventRenderer();

  // Up to where time has been rendered; 0 at first.
  int64_t time_us() const;
  // Renders up to `end_us`, a multiple of kCellUs, and appends in order of time.
  // INVALID_ARGUMENT: no such multiple, before time_us(), or the wand's motion is not finite.
  absl::Status Render(int64_t end_us, const WandPath& wand, std::vector<SimulatedEvent>* events,
                      std::vector<SimulatedTrigger>* triggers);

  // Projections of the spheres' centres, whether inside, distance and radius.
  std::vector<MarkerGroundTruth> TruthOf(const WandMotion& wand) const;
  // True if the LED of a marker is lit.
  bool IsLit(int marker, double time_s) const;
  // Events that were never read because too many waited.
  uint64_t lost_events() const;

 private:
  struct Impl;
  explicit EventRenderer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace rigcal

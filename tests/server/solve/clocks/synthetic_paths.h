// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "server/solve/clocks/ray_paths.h"

namespace rigcal::server {

struct SyntheticView {
  int view = 0;  // which of several cameras around the motion
  size_t markers = 3;
  double duration_s = 60;
  double start_s = 0;  // of the recording, in the motion's own time
  double rate_hz = 40;
  double offset_s = 0;  // the motion's time minus the track's
  double period_s = 0;  // the motion repeats itself after so long; 0: never
  double noise_px = 0.3;
  double size = 1;    // of the motion, against a usual wave
  uint32_t seed = 1;  // of the motion and the noise
};

// A wand of markers 0.2 m apart, waved in front of cameras of 1000 px that all see it always: a
// track with its rays as PathsOf() would make them.
TrackPaths SyntheticPaths(const SyntheticView& view);

}  // namespace rigcal::server

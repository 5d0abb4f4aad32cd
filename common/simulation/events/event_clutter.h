// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "common/camera/intrinsics.h"
#include "common/simulation/events/event_render_options.h"
#include "common/simulation/frames/edge_profile.h"
#include "common/simulation/frames/pixel_spans.h"
#include "common/simulation/frames/sphere_image.h"

namespace rigcal {

// Bars that go to and fro before the room, and lamps that flicker, as an event camera sees them.
class EventClutter {
 public:
  // `room`: light of each pixel, row by row, > 0. `lamp_light`: mean of a lamp.
  EventClutter(const ImageSize& size, const EventRenderOptions& options, std::vector<float> room,
               float lamp_light, const EdgeProfile& profile);

  // Positions of the bars and brightness of the lamps.
  struct Instant {
    std::vector<double> bar_px;
    std::vector<float> lamp_light;
  };
  void InstantAt(double time_s, Instant* instant) const;
  // Light of columns [begin, end) of a row.
  void LightOf(int y, PixelSpan columns, const Instant& instant, float* light) const;

  // Into how many parts a stretch of time must be cut so that within each the logarithm of the
  // light goes nearly linearly, where bars move and where lamps flicker.
  int BarParts(double duration_s) const;
  int LampParts(double duration_s) const;
  // Appends the columns of a row whose light the bars change between two instants, and by the
  // lamps; in no order, some twice.
  void AddBarSpans(int y, const Instant& begin, const Instant& end,
                   std::vector<PixelSpan>* spans) const;
  void AddLampSpans(int y, std::vector<PixelSpan>* spans) const;

 private:
  struct Bar {
    double start_px = 0, speed_px_s = 0, range_px = 0;
    double half_width_px = 0, slant = 0, cosine = 1;
    int y_begin = 0, y_end = 0;
    float factor = 0;     // its light over the room's, less one
    double reach_px = 0;  // to either side of its edge, along a row, it changes the light
    bool HasRow(int y) const { return y >= y_begin && y < y_end; }
    double CentreAt(double time_s) const;
    double MiddleIn(int y, double centre_px) const { return centre_px + slant * (y - y_begin); }
  };
  struct Lamp {
    ImagePatch patch;
    std::vector<float> cover;  // by pixel of the patch
    double hz = 0, phase = 0;
    float light = 0, modulation = 0;
  };
  Bar DrawBar(const EventRenderOptions& options, bool brighter, class RandomStream* draw) const;
  Lamp DrawLamp(const EventRenderOptions& options, float light, class RandomStream* draw) const;

  ImageSize size_;
  std::vector<float> room_;
  EdgeProfile profile_;
  std::vector<Bar> bars_;
  std::vector<Lamp> lamps_;
  double fastest_bar_px_s_ = 0, fastest_lamp_hz_ = 0;
};

}  // namespace rigcal

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "common/camera/intrinsics.h"
#include "common/simulation/edge_profile.h"
#include "common/simulation/event_render_options.h"
#include "common/simulation/sphere_image.h"

namespace rigcal {

// Bars that go to and fro before the room, and lamps that flicker, as an event camera sees them.
class EventClutter {
 public:
  // `room`: light of each pixel, row by row, > 0. `lamp_light`: mean of a lamp. The profile must
  // outlive this.
  EventClutter(const ImageSize& size, const EventRenderOptions& options, std::vector<float> room,
               float lamp_light, const EdgeProfile* profile);

  // Where the bars are and how bright the lamps.
  struct Moment {
    std::vector<double> bar_px;
    std::vector<float> lamp_light;
  };
  Moment MomentAt(double time_s) const;
  // Light of a pixel.
  float LightAt(uint32_t x, uint32_t y, const Moment& moment) const;

  // Calls visit(x, y) for every pixel whose light changes by the lamps.
  template <typename Visit>
  void ForLamps(Visit visit) const {
    for (const Lamp& lamp : lamps_) {
      for (int y = lamp.patch.y; y < lamp.patch.y + lamp.patch.height; ++y) {
        for (int x = lamp.patch.x; x < lamp.patch.x + lamp.patch.width; ++x) visit(x, y);
      }
    }
  }
  // And by the bars between two moments, some twice.
  template <typename Visit>
  void ForBars(const Moment& begin, const Moment& end, Visit visit) const {
    for (size_t i = 0; i < bars_.size(); ++i) {
      const Bar& bar = bars_[i];
      const double at = begin.bar_px[i], then = end.bar_px[i];
      const double reach = profile_->reach_px() / bar.cosine + 1;
      for (int y = bar.y_begin; y < bar.y_end; ++y) {
        for (const double side : {-bar.half_width_px, bar.half_width_px}) {
          const double shift = side + bar.slant * (y - bar.y_begin);
          const int from = Column(std::min(at, then) + shift - reach);
          const int to = Column(std::max(at, then) + shift + reach);
          for (int x = from; x < to; ++x) visit(x, y);
        }
      }
    }
  }

 private:
  struct Bar {
    double start_px = 0, speed_px_s = 0, range_px = 0;
    double half_width_px = 0, slant = 0, cosine = 1;
    int y_begin = 0, y_end = 0;
    float factor = 0;  // its light over the room's, less one
    double CentreAt(double time_s) const;
  };
  struct Lamp {
    ImagePatch patch;
    double x = 0, y = 0, radius_px = 0, hz = 0, phase = 0;
    float light = 0, modulation = 0;
  };
  int Column(double x) const;

  ImageSize size_;
  std::vector<float> room_;
  const EdgeProfile* profile_;
  std::vector<Bar> bars_;
  std::vector<Lamp> lamps_;
};

}  // namespace rigcal

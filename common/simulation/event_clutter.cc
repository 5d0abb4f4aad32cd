// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/event_clutter.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "common/simulation/random_stream.h"

namespace rigcal {

EventClutter::EventClutter(const ImageSize& size, const EventRenderOptions& options,
                           std::vector<float> room, float lamp_light, const EdgeProfile* profile)
    : size_(size), room_(std::move(room)), profile_(profile) {
  RandomStream draw({options.seed, 0x8c41});
  const auto width = static_cast<double>(size.width), height = static_cast<double>(size.height);
  for (int i = 0; i < static_cast<int>(options.bars); ++i) {
    Bar bar;
    bar.start_px = draw.Uniform(0, 2 * width);
    bar.range_px = width;
    bar.half_width_px = draw.Uniform(5, 40);
    bar.slant = draw.Uniform(-1, 1);
    bar.cosine = 1 / std::sqrt(1 + bar.slant * bar.slant);
    bar.speed_px_s = options.bar_px_s / bar.cosine;
    const double rows = std::min(height, options.bar_px * bar.cosine);
    bar.y_begin = static_cast<int>(draw.Uniform(0, height - rows));
    bar.y_end = bar.y_begin + static_cast<int>(rows);
    bar.factor =
        static_cast<float>(std::exp(i % 2 == 0 ? options.bar_contrast : -options.bar_contrast) - 1);
    bars_.push_back(bar);
  }
  for (int i = 0; i < static_cast<int>(options.lamps); ++i) {
    Lamp lamp;
    lamp.x = draw.Uniform(0, width);
    lamp.y = draw.Uniform(0, height);
    lamp.radius_px = options.lamp_radius_px;
    lamp.hz = options.lamp_hz * (i % 2 == 0 ? 1 : 1.2);
    lamp.phase = draw.Uniform();
    lamp.light = lamp_light;
    lamp.modulation = static_cast<float>(options.lamp_modulation);
    const double reach = lamp.radius_px + profile->reach_px() + 1;
    lamp.patch.x = Column(lamp.x - reach);
    lamp.patch.width = Column(lamp.x + reach) - lamp.patch.x;
    lamp.patch.y = static_cast<int>(std::clamp(lamp.y - reach, 0.0, height));
    lamp.patch.height = static_cast<int>(std::clamp(lamp.y + reach, 0.0, height)) - lamp.patch.y;
    lamps_.push_back(lamp);
  }
}

int EventClutter::Column(double x) const {
  return static_cast<int>(std::clamp(x, 0.0, static_cast<double>(size_.width)));
}

double EventClutter::Bar::CentreAt(double time_s) const {
  const double way = std::fmod(start_px + speed_px_s * time_s, 2 * range_px);
  return way < range_px ? way : 2 * range_px - way;
}

EventClutter::Moment EventClutter::MomentAt(double time_s) const {
  Moment moment;
  for (const Bar& bar : bars_) moment.bar_px.push_back(bar.CentreAt(time_s));
  for (const Lamp& lamp : lamps_) {
    const double turn = 2 * std::numbers::pi * (lamp.hz * time_s + lamp.phase);
    moment.lamp_light.push_back(lamp.light *
                                (1 + lamp.modulation * static_cast<float>(std::sin(turn))));
  }
  return moment;
}

float EventClutter::LightAt(uint32_t x, uint32_t y, const Moment& moment) const {
  float light = room_[static_cast<size_t>(y) * size_.width + x];
  const auto column = static_cast<int>(x), row = static_cast<int>(y);
  for (size_t i = 0; i < bars_.size(); ++i) {
    const Bar& bar = bars_[i];
    if (row < bar.y_begin || row >= bar.y_end) continue;
    const double middle = moment.bar_px[i] + bar.slant * (row - bar.y_begin);
    const double inside = (bar.half_width_px - std::abs(column - middle)) * bar.cosine;
    light *= 1 + bar.factor * profile_->At(static_cast<float>(inside));
  }
  for (size_t i = 0; i < lamps_.size(); ++i) {
    const Lamp& lamp = lamps_[i];
    if (column < lamp.patch.x || column >= lamp.patch.x + lamp.patch.width || row < lamp.patch.y ||
        row >= lamp.patch.y + lamp.patch.height) {
      continue;
    }
    const double away = std::hypot(column - lamp.x, row - lamp.y);
    const float cover = profile_->At(static_cast<float>(lamp.radius_px - away));
    light += cover * (moment.lamp_light[i] - light);
  }
  return light;
}

}  // namespace rigcal

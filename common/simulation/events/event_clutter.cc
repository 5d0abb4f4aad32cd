// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/events/event_clutter.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "common/simulation/world/random_stream.h"

namespace rigcal {
namespace {

// Beyond this change of ln(light) an edge goes on.
constexpr float kEdgeLight = 1e-3f;
// Of an edge within one part, and of a lamp's period.
constexpr double kClutterPartPx = 0.35;
constexpr double kPartTurns = 1.0 / 16;
constexpr double kMaxParts = 40;
constexpr double kMainsPhases = 3;

int Parts(double wanted) { return static_cast<int>(std::ceil(std::clamp(wanted, 1.0, kMaxParts))); }

int Within(uint32_t side, double value) {
  return static_cast<int>(std::clamp(value, 0.0, static_cast<double>(side)));
}

// The distance from an edge, on either side, within which a bar of this factor changes the light.
double EdgeReach(const EdgeProfile& profile, float factor) {
  constexpr double kStepPx = 0.05;
  double reach = profile.reach_px();
  while (reach > kStepPx) {
    const float share = profile.At(static_cast<float>(kStepPx - reach));
    const float outside = std::abs(std::log1p(factor * share));
    const float inside = std::abs(std::log1p(-factor * share / (1 + factor)));
    if (std::max(outside, inside) > kEdgeLight) break;
    reach -= kStepPx;
  }
  return reach;
}

}  // namespace

EventClutter::EventClutter(const ImageSize& size, const EventRenderOptions& options,
                           std::vector<float> room, float lamp_light, const EdgeProfile& profile)
    : size_(size), room_(std::move(room)), profile_(profile) {
  RandomStream draw({options.seed, 0x8c41});
  for (int i = 0; i < static_cast<int>(options.bars); ++i) {
    bars_.push_back(DrawBar(options, i % 2 == 0, &draw));
  }
  for (int i = 0; i < static_cast<int>(options.lamps); ++i) {
    lamps_.push_back(DrawLamp(options, lamp_light, &draw));
    lamps_.back().hz *= i % 2 == 0 ? 1 : 1.2;
    fastest_lamp_hz_ = std::max(fastest_lamp_hz_, lamps_.back().hz);
  }
  if (!bars_.empty()) fastest_bar_px_s_ = options.bar_px_s;
}

EventClutter::Bar EventClutter::DrawBar(const EventRenderOptions& options, bool brighter,
                                        RandomStream* draw) const {
  const auto width = static_cast<double>(size_.width), height = static_cast<double>(size_.height);
  Bar bar;
  bar.start_px = draw->Uniform(0, 2 * width);
  bar.range_px = width;
  bar.half_width_px = draw->Uniform(5, 40);
  bar.slant = draw->Uniform(-1, 1);
  bar.cosine = 1 / std::sqrt(1 + bar.slant * bar.slant);
  bar.speed_px_s = options.bar_px_s / bar.cosine;
  const double rows = std::min(height, options.bar_px * bar.cosine);
  bar.y_begin = static_cast<int>(draw->Uniform(0, height - rows));
  bar.y_end = bar.y_begin + static_cast<int>(rows);
  bar.factor =
      static_cast<float>(std::expm1(brighter ? options.bar_contrast : -options.bar_contrast));
  bar.reach_px = EdgeReach(profile_, bar.factor) / bar.cosine + 1;
  return bar;
}

EventClutter::Lamp EventClutter::DrawLamp(const EventRenderOptions& options, float light,
                                          RandomStream* draw) const {
  const double x = draw->Uniform(0, size_.width), y = draw->Uniform(0, size_.height);
  Lamp lamp;
  lamp.hz = options.lamp_hz;
  lamp.phase = std::floor(kMainsPhases * draw->Uniform()) / kMainsPhases;
  lamp.light = light;
  lamp.modulation = static_cast<float>(options.lamp_modulation);
  const double reach = options.lamp_radius_px + profile_.reach_px() + 1;
  lamp.patch.x = Within(size_.width, x - reach);
  lamp.patch.width = Within(size_.width, x + reach) - lamp.patch.x;
  lamp.patch.y = Within(size_.height, y - reach);
  lamp.patch.height = Within(size_.height, y + reach) - lamp.patch.y;
  for (int row = 0; row < lamp.patch.height; ++row) {
    for (int column = 0; column < lamp.patch.width; ++column) {
      const double away = std::hypot(lamp.patch.x + column - x, lamp.patch.y + row - y);
      lamp.cover.push_back(profile_.At(static_cast<float>(options.lamp_radius_px - away)));
    }
  }
  return lamp;
}

double EventClutter::Bar::CentreAt(double time_s) const {
  const double way = std::fmod(start_px + speed_px_s * time_s, 2 * range_px);
  return way < range_px ? way : 2 * range_px - way;
}

void EventClutter::InstantAt(double time_s, Instant* instant) const {
  instant->bar_px.clear();
  instant->lamp_light.clear();
  for (const Bar& bar : bars_) instant->bar_px.push_back(bar.CentreAt(time_s));
  for (const Lamp& lamp : lamps_) {
    const double turn = 2 * std::numbers::pi * (lamp.hz * time_s + lamp.phase);
    instant->lamp_light.push_back(lamp.light *
                                  (1 + lamp.modulation * static_cast<float>(std::sin(turn))));
  }
}

void EventClutter::LightOf(int y, PixelSpan columns, const Instant& instant, float* light) const {
  const float* room = &room_[static_cast<size_t>(y) * size_.width];
  std::copy(room + columns.begin, room + columns.end, light);
  for (size_t i = 0; i < bars_.size(); ++i) {
    const Bar& bar = bars_[i];
    if (!bar.HasRow(y)) continue;
    const double middle = bar.MiddleIn(y, instant.bar_px[i]);
    const double half = bar.half_width_px + bar.reach_px;
    if (middle + half <= columns.begin || middle - half >= columns.end) continue;
    const int begin = std::max(columns.begin, static_cast<int>(middle - half));
    const int end = std::min(columns.end, static_cast<int>(middle + half));
    const auto cosine = static_cast<float>(bar.cosine);
    const auto half_width = static_cast<float>(bar.half_width_px);
    auto away = static_cast<float>(begin - middle);
    for (int x = begin; x < end; ++x, ++away) {
      const float inside = (half_width - std::abs(away)) * cosine;
      light[x - columns.begin] *= 1 + bar.factor * profile_.At(inside);
    }
  }
  for (size_t i = 0; i < lamps_.size(); ++i) {
    const ImagePatch& patch = lamps_[i].patch;
    if (!patch.HasRow(y)) continue;
    const float* cover = &lamps_[i].cover[patch.IndexOf(patch.x, y)];
    const int end = std::min(columns.end, patch.x + patch.width);
    for (int x = std::max(columns.begin, patch.x); x < end; ++x) {
      float& one = light[x - columns.begin];
      one += cover[x - patch.x] * (instant.lamp_light[i] - one);
    }
  }
}

int EventClutter::BarParts(double duration_s) const {
  return Parts(fastest_bar_px_s_ * duration_s / kClutterPartPx);
}

int EventClutter::LampParts(double duration_s) const {
  return std::max(BarParts(duration_s), Parts(fastest_lamp_hz_ * duration_s / kPartTurns));
}

void EventClutter::AddBarSpans(int y, const Instant& begin, const Instant& end,
                               std::vector<PixelSpan>* spans) const {
  for (size_t i = 0; i < bars_.size(); ++i) {
    const Bar& bar = bars_[i];
    if (!bar.HasRow(y)) continue;
    const double from = bar.MiddleIn(y, std::min(begin.bar_px[i], end.bar_px[i])) - bar.reach_px;
    const double to = bar.MiddleIn(y, std::max(begin.bar_px[i], end.bar_px[i])) + bar.reach_px;
    for (const double side : {-bar.half_width_px, bar.half_width_px}) {
      spans->push_back({Within(size_.width, from + side), Within(size_.width, to + side)});
    }
  }
}

void EventClutter::AddLampSpans(int y, std::vector<PixelSpan>* spans) const {
  for (const Lamp& lamp : lamps_) {
    if (!lamp.patch.HasRow(y)) continue;
    spans->push_back({lamp.patch.x, lamp.patch.x + lamp.patch.width});
  }
}

}  // namespace rigcal

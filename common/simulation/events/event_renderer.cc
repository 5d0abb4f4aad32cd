// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/events/event_renderer.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/simulation/events/fast_math.h"
#include "common/simulation/frames/light_model.h"
#include "common/simulation/frames/room_background.h"
#include "common/simulation/frames/sensor_noise.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

constexpr uint32_t kMaxSidePx = 2048;
// Of the light of the LED: what a pixel sees in the deepest dark.
constexpr float kDarkShare = 0.002f;
constexpr double kCellS = 1e-6 * EventRenderer::kCellUs;

float Luminance(double blue, double green, double red) {
  return static_cast<float>((blue + green + red) / 3);
}

EventLight EventLightOf(const FrameRenderOptions& scene) {
  const LightModel model(scene);
  EventLight light;
  light.led = Luminance(model.led_grey[0], model.led_grey[1], model.led_grey[2]);
  light.shell = static_cast<float>(model.shell_grey);
  light.dark = std::max(1e-6f, light.led * kDarkShare);
  return light;
}

std::vector<float> RoomLight(const ImageSize& size, const FrameRenderOptions& scene,
                             const EdgeProfile& profile, float dark) {
  const std::vector<int16_t> linear = RenderRoom(size, scene, LightModel(scene), profile);
  std::vector<float> room(linear.size() / 3);
  for (size_t i = 0; i < room.size(); ++i) {
    room[i] = std::max(0.0f, Luminance(linear[3 * i], linear[3 * i + 1], linear[3 * i + 2]) /
                                 kLinearPerGrey) +
              dark;
  }
  return room;
}

}  // namespace

absl::StatusOr<EventRenderer> EventRenderer::Create(const Intrinsics& intrinsics,
                                                    const ImageSize& image_size,
                                                    const Target& target,
                                                    const FrameRenderOptions& scene,
                                                    const EventRenderOptions& options) {
  RIGCAL_RETURN_IF_ERROR(image_size.Validate());
  if (std::max(image_size.width, image_size.height) > kMaxSidePx) {
    return absl::InvalidArgumentError(absl::StrCat("event renderer: ", image_size.width, "x",
                                                   image_size.height,
                                                   " pixels, but sides must be up to 2048"));
  }
  RIGCAL_RETURN_IF_ERROR(intrinsics.Validate(image_size));
  RIGCAL_RETURN_IF_ERROR(target.Validate());
  RIGCAL_RETURN_IF_ERROR(scene.Validate());
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  RIGCAL_ASSIGN_OR_RETURN(SphereImager imager, SphereImager::Create(intrinsics, image_size));
  return EventRenderer(std::move(imager), target, scene, options);
}

EventRenderer::EventRenderer(SphereImager imager, const Target& target,
                             const FrameRenderOptions& scene, const EventRenderOptions& options)
    : size_(imager.image_size()),
      trigger_hz_(options.trigger_hz),
      profile_(scene.defocus_px, scene.defocus_disc_px),
      light_(EventLightOf(scene)),
      spheres_(std::move(imager), profile_, target, scene, options.led_phase, light_),
      clutter_(size_, options, RoomLight(size_, scene, profile_, light_.dark),
               0.5f * light_.led + light_.dark, profile_),
      noise_(size_, options),
      pixels_(size_, options, FastLog(std::max(light_.led, light_.dark))),
      readout_(size_.height, 1e-3 * options.row_ns, 1e-3 * options.event_ns),
      bar_instants_(static_cast<size_t>(clutter_.BarParts(kCellS)) + 1),
      lamp_instants_(static_cast<size_t>(clutter_.LampParts(kCellS)) + 1) {
  clutter_.InstantAt(0, &lamp_instants_[0]);
  for (uint32_t y = 0; y < size_.height; ++y) {
    const RowSpan row{y, {0, static_cast<int>(size_.width)}};
    LogLight({&row, 1}, lamp_instants_[0]);
    for (uint32_t x = 0; x < size_.width; ++x) pixels_.Settle(x, y, log_light_[x]);
  }
}

// Of one span after the other.
void EventRenderer::LogLight(std::span<const RowSpan> spans, const EventClutter::Instant& instant) {
  size_t count = 0;
  for (const RowSpan& span : spans) count += span.columns.size();
  log_light_.resize(count);
  float* next = log_light_.data();
  for (const auto& [y, columns] : spans) {
    clutter_.LightOf(static_cast<int>(y), columns, instant, next);
    next += columns.size();
  }
  for (float& one : log_light_) one = FastLog(one);
}

void EventRenderer::InstantsOf(std::span<EventClutter::Instant> instants) const {
  const double begin_s = 1e-6 * static_cast<double>(now_us_);
  const double parts = static_cast<double>(instants.size() - 1);
  for (size_t i = 0; i < instants.size(); ++i) {
    clutter_.InstantAt(begin_s + static_cast<double>(i) / parts * kCellS, &instants[i]);
  }
}

void EventRenderer::FollowSpans(std::span<const RowSpan> spans,
                                std::span<const EventClutter::Instant> instants) {
  const double part_us = static_cast<double>(kCellUs) / static_cast<double>(instants.size() - 1);
  for (size_t i = 1; i < instants.size(); ++i) {
    LogLight(spans, instants[i]);
    std::span<const float> rest = log_light_;
    for (const auto& [y, columns] : spans) {
      pixels_.Add(static_cast<uint32_t>(columns.begin), y, {}, rest.first(columns.size()));
      rest = rest.subspan(columns.size());
    }
    const double begin_us = static_cast<double>(now_us_) + static_cast<double>(i - 1) * part_us;
    pixels_.FollowAdded(begin_us, part_us, &requests_);
  }
}

// Each pixel once: spheres before lamps before bars.
void EventRenderer::FollowClutter() {
  InstantsOf(bar_instants_);
  InstantsOf(lamp_instants_);
  lamp_rows_.clear();
  bar_rows_.clear();
  for (uint32_t y = 0; y < size_.height; ++y) {
    const auto row = static_cast<int>(y);
    lamp_spans_.clear();
    bar_spans_.clear();
    clutter_.AddLampSpans(row, &lamp_spans_);
    clutter_.AddBarSpans(row, bar_instants_.front(), bar_instants_.back(), &bar_spans_);
    if (lamp_spans_.empty() && bar_spans_.empty()) continue;
    sphere_spans_.clear();
    spheres_.AddSpans(row, &sphere_spans_);
    for (auto* spans : {&sphere_spans_, &lamp_spans_, &bar_spans_}) MergeSpans(spans);
    SubtractSpans(sphere_spans_, &lamp_spans_);
    SubtractSpans(sphere_spans_, &bar_spans_);
    SubtractSpans(lamp_spans_, &bar_spans_);
    for (const PixelSpan& columns : lamp_spans_) lamp_rows_.push_back({y, columns});
    for (const PixelSpan& columns : bar_spans_) bar_rows_.push_back({y, columns});
  }
  FollowSpans(lamp_rows_, lamp_instants_);
  FollowSpans(bar_rows_, bar_instants_);
}

absl::Status EventRenderer::RenderCell(const WandPath& path, std::vector<SimulatedEvent>* events) {
  RIGCAL_RETURN_IF_ERROR(spheres_.DrawCell(now_us_, kCellUs, path));
  const int parts = spheres_.parts();
  sphere_instants_.resize(static_cast<size_t>(parts) + 1);
  InstantsOf(sphere_instants_);
  for (int part = 0; part < parts; ++part) {
    const auto i = static_cast<size_t>(part);
    noise_events_.clear();
    noise_.Until(static_cast<double>(now_us_ + (part + 1) * kCellUs / parts), &noise_events_);
    pixels_.Fire(noise_events_, &requests_);
    spheres_.Follow(part, clutter_, sphere_instants_[i], sphere_instants_[i + 1], &pixels_,
                    &requests_);
  }
  FollowClutter();
  now_us_ += kCellUs;
  readout_.Read(&requests_, static_cast<double>(now_us_), events);
  return absl::OkStatus();
}

void EventRenderer::AddTriggers(int64_t end_us, std::vector<SimulatedTrigger>* triggers) const {
  if (trigger_hz_ <= 0) return;
  const double half_us = 0.5e6 / trigger_hz_;
  for (auto k = static_cast<int64_t>(std::ceil(static_cast<double>(now_us_) / half_us - 1));; ++k) {
    const auto at_us = static_cast<int64_t>(std::llround(static_cast<double>(k) * half_us));
    if (at_us >= end_us) break;
    if (at_us >= now_us_) triggers->push_back({at_us, k % 2 == 0});
  }
}

absl::Status EventRenderer::Render(int64_t end_us, const WandPath& wand,
                                   std::vector<SimulatedEvent>* events,
                                   std::vector<SimulatedTrigger>* triggers) {
  if (end_us < now_us_ || end_us % kCellUs != 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("event renderer: asked to render up to ", end_us, " us, but it is at ",
                     now_us_, " us and goes on by multiples of ", kCellUs, " us"));
  }
  AddTriggers(end_us, triggers);
  while (now_us_ < end_us) RIGCAL_RETURN_IF_ERROR(RenderCell(wand, events));
  return absl::OkStatus();
}

}  // namespace rigcal

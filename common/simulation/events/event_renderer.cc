// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/events/event_renderer.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/simulation/events/event_clutter.h"
#include "common/simulation/events/event_noise.h"
#include "common/simulation/events/event_pixels.h"
#include "common/simulation/events/event_spheres.h"
#include "common/simulation/events/fast_math.h"
#include "common/simulation/frames/edge_profile.h"
#include "common/simulation/frames/light_model.h"
#include "common/simulation/frames/pixel_spans.h"
#include "common/simulation/frames/ray_grid.h"
#include "common/simulation/frames/room_background.h"
#include "common/simulation/frames/sensor_noise.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

constexpr uint32_t kMaxSidePx = 2048;
// Of the light of the LED: what a pixel sees in the deepest dark.
constexpr float kDarkShare = 0.002f;
constexpr double kCellS = 1e-6 * EventRenderer::kCellUs;

struct RowSpan {
  uint32_t y = 0;
  PixelSpan columns;
};

float Luminance(double blue, double green, double red) {
  return static_cast<float>((blue + green + red) / 3);
}

EventLight LightOf(const LightModel& model) {
  EventLight light;
  light.led = Luminance(model.led_grey[0], model.led_grey[1], model.led_grey[2]);
  light.shell = static_cast<float>(model.shell_grey);
  light.dark = std::max(1e-6f, light.led * kDarkShare);
  return light;
}

std::vector<float> RoomLight(const ImageSize& size, const FrameRenderOptions& scene,
                             const LightModel& light, const EdgeProfile& profile, float dark) {
  const std::vector<int16_t> linear = RenderRoom(size, scene, light, profile);
  std::vector<float> room(linear.size() / 3);
  for (size_t i = 0; i < room.size(); ++i) {
    room[i] = std::max(0.0f, Luminance(linear[3 * i], linear[3 * i + 1], linear[3 * i + 2]) /
                                 kLinearPerGrey) +
              dark;
  }
  return room;
}

}  // namespace

struct EventRenderer::Impl {
  Impl(const Intrinsics& lens, const ImageSize& image_size, const Target& target,
       const FrameRenderOptions& scene, const EventRenderOptions& event_options, RayGrid rays)
      : intrinsics(lens),
        size(image_size),
        options(event_options),
        light_model(scene),
        light(LightOf(light_model)),
        profile(scene.defocus_px, scene.defocus_disc_px),
        grid(std::move(rays)),
        spheres(&intrinsics, size, &grid, &profile, target, scene, options.led_phase, light),
        clutter(size, options, RoomLight(size, scene, light_model, profile, light.dark),
                0.5f * light.led + light.dark, &profile),
        noise(size, options),
        pixels(size, options, FastLog(std::max(light.led, light.dark))),
        readout(size.height, 1e-3 * options.row_ns, 1e-3 * options.event_ns),
        bar_instants(static_cast<size_t>(clutter.BarParts(kCellS)) + 1),
        lamp_instants(static_cast<size_t>(clutter.LampParts(kCellS)) + 1) {
    clutter.InstantAt(0, &lamp_instants[0]);
    for (uint32_t y = 0; y < size.height; ++y) {
      const RowSpan row{y, {0, static_cast<int>(size.width)}};
      LogLight({&row, 1}, lamp_instants[0]);
      for (uint32_t x = 0; x < size.width; ++x) pixels.Settle(x, y, log_light[x]);
    }
  }

  // Of one span after the other.
  void LogLight(std::span<const RowSpan> spans, const EventClutter::Instant& instant) {
    size_t count = 0;
    for (const RowSpan& span : spans) count += span.columns.size();
    log_light.resize(count);
    float* next = log_light.data();
    for (const auto& [y, columns] : spans) {
      clutter.LightOf(static_cast<int>(y), columns, instant, next);
      next += columns.size();
    }
    for (float& one : log_light) one = FastLog(one);
  }

  void InstantsOf(std::span<EventClutter::Instant> instants) const {
    const double begin_s = 1e-6 * static_cast<double>(now_us);
    const double parts = static_cast<double>(instants.size() - 1);
    for (size_t i = 0; i < instants.size(); ++i) {
      clutter.InstantAt(begin_s + static_cast<double>(i) / parts * kCellS, &instants[i]);
    }
  }

  void FollowSpans(std::span<const RowSpan> spans,
                   std::span<const EventClutter::Instant> instants) {
    const double part_us = static_cast<double>(kCellUs) / static_cast<double>(instants.size() - 1);
    for (size_t i = 1; i < instants.size(); ++i) {
      LogLight(spans, instants[i]);
      std::span<const float> rest = log_light;
      for (const auto& [y, columns] : spans) {
        pixels.Add(static_cast<uint32_t>(columns.begin), y, {}, rest.first(columns.size()));
        rest = rest.subspan(columns.size());
      }
      const double begin_us = static_cast<double>(now_us) + static_cast<double>(i - 1) * part_us;
      pixels.FollowAdded(begin_us, part_us, &requests);
    }
  }

  // Each pixel once: spheres before lamps before bars.
  void FollowClutter() {
    InstantsOf(bar_instants);
    InstantsOf(lamp_instants);
    lamp_rows.clear();
    bar_rows.clear();
    for (uint32_t y = 0; y < size.height; ++y) {
      const auto row = static_cast<int>(y);
      lamp_spans.clear();
      bar_spans.clear();
      clutter.AddLampSpans(row, &lamp_spans);
      clutter.AddBarSpans(row, bar_instants.front(), bar_instants.back(), &bar_spans);
      if (lamp_spans.empty() && bar_spans.empty()) continue;
      sphere_spans.clear();
      spheres.AddSpans(row, &sphere_spans);
      for (auto* spans : {&sphere_spans, &lamp_spans, &bar_spans}) MergeSpans(spans);
      SubtractSpans(sphere_spans, &lamp_spans);
      SubtractSpans(sphere_spans, &bar_spans);
      SubtractSpans(lamp_spans, &bar_spans);
      for (const PixelSpan& columns : lamp_spans) lamp_rows.push_back({y, columns});
      for (const PixelSpan& columns : bar_spans) bar_rows.push_back({y, columns});
    }
    FollowSpans(lamp_rows, lamp_instants);
    FollowSpans(bar_rows, bar_instants);
  }

  absl::Status RenderCell(const WandPath& path, std::vector<SimulatedEvent>* events) {
    RIGCAL_RETURN_IF_ERROR(spheres.DrawCell(now_us, kCellUs, path));
    const int parts = spheres.parts();
    sphere_instants.resize(static_cast<size_t>(parts) + 1);
    InstantsOf(sphere_instants);
    for (int part = 0; part < parts; ++part) {
      const auto i = static_cast<size_t>(part);
      noise_events.clear();
      noise.Until(static_cast<double>(now_us + (part + 1) * kCellUs / parts), &noise_events);
      pixels.Fire(noise_events, &requests);
      spheres.Follow(part, clutter, sphere_instants[i], sphere_instants[i + 1], &pixels, &requests);
    }
    FollowClutter();
    now_us += kCellUs;
    readout.Read(&requests, static_cast<double>(now_us), events);
    return absl::OkStatus();
  }

  void AddTriggers(int64_t begin_us, int64_t end_us, std::vector<SimulatedTrigger>* triggers) {
    if (options.trigger_hz <= 0) return;
    const double half_us = 0.5e6 / options.trigger_hz;
    for (auto k = static_cast<int64_t>(std::ceil(static_cast<double>(begin_us) / half_us - 1));;
         ++k) {
      const auto at_us = static_cast<int64_t>(std::llround(static_cast<double>(k) * half_us));
      if (at_us >= end_us) break;
      if (at_us >= begin_us) triggers->push_back({at_us, k % 2 == 0});
    }
  }

  Intrinsics intrinsics;
  ImageSize size;
  EventRenderOptions options;
  LightModel light_model;
  EventLight light;
  EdgeProfile profile;
  RayGrid grid;
  EventSpheres spheres;
  EventClutter clutter;
  EventNoise noise;
  EventPixels pixels;
  EventReadout readout;
  std::vector<EventClutter::Instant> sphere_instants, bar_instants, lamp_instants;
  std::vector<PixelSpan> sphere_spans, lamp_spans, bar_spans;
  std::vector<RowSpan> lamp_rows, bar_rows;
  std::vector<float> log_light;
  std::vector<NoiseEvent> noise_events;
  std::vector<PixelRequest> requests;
  int64_t now_us = 0;
};

EventRenderer::EventRenderer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
EventRenderer::EventRenderer(EventRenderer&&) noexcept = default;
EventRenderer& EventRenderer::operator=(EventRenderer&&) noexcept = default;
EventRenderer::~EventRenderer() = default;

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
  auto grid = RayGrid::Create(intrinsics, image_size);
  if (!grid.ok()) return grid.status();
  return EventRenderer(
      std::make_unique<Impl>(intrinsics, image_size, target, scene, options, *std::move(grid)));
}

int64_t EventRenderer::time_us() const { return impl_->now_us; }
uint64_t EventRenderer::lost_events() const { return impl_->readout.lost(); }

absl::Status EventRenderer::Render(int64_t end_us, const WandPath& wand,
                                   std::vector<SimulatedEvent>* events,
                                   std::vector<SimulatedTrigger>* triggers) {
  if (end_us < impl_->now_us || end_us % kCellUs != 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("event renderer: asked to render up to ", end_us, " us, but it is at ",
                     impl_->now_us, " us and goes on by multiples of ", kCellUs, " us"));
  }
  impl_->AddTriggers(impl_->now_us, end_us, triggers);
  while (impl_->now_us < end_us) RIGCAL_RETURN_IF_ERROR(impl_->RenderCell(wand, events));
  return absl::OkStatus();
}

std::vector<MarkerGroundTruth> EventRenderer::TruthOf(const WandMotion& wand) const {
  return impl_->spheres.TruthOf(wand);
}

bool EventRenderer::IsLit(int marker, double time_s) const {
  return impl_->spheres.IsLit(static_cast<size_t>(marker), time_s);
}

}  // namespace rigcal

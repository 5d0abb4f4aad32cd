// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/event_renderer.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/simulation/edge_profile.h"
#include "common/simulation/event_clutter.h"
#include "common/simulation/event_pixels.h"
#include "common/simulation/light_model.h"
#include "common/simulation/random_stream.h"
#include "common/simulation/ray_grid.h"
#include "common/simulation/room_background.h"
#include "common/simulation/scene_truth.h"
#include "common/simulation/sensor_noise.h"
#include "common/simulation/sphere_image.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

constexpr double kDefaultDiameterM = 0.04;
constexpr uint32_t kMaxSidePx = 2048;
// Of the light of the LED: what a pixel sees in the deepest dark.
constexpr float kDarkShare = 0.002f;
// Around a sphere: where pixels may still settle after it has passed.
constexpr int kSettlePx = 2;

float Luminance(double blue, double green, double red) {
  return static_cast<float>((blue + green + red) / 3);
}

// What a marker's LED and sphere do.
struct Marker {
  double position_m = 0;
  double blink_hz = 0;
  SphereImage before, after;  // at both ends of a cell
  ImagePatch patch;           // of both, with room to settle
  std::vector<LightStep> steps;
};

float At(const ImagePatch& patch, const std::vector<float>& values, int x, int y) {
  if (x < patch.x || y < patch.y || x >= patch.x + patch.width || y >= patch.y + patch.height) {
    return 0;
  }
  return values[static_cast<size_t>(y - patch.y) * static_cast<size_t>(patch.width) +
                static_cast<size_t>(x - patch.x)];
}

ImagePatch Union(const ImagePatch& a, const ImagePatch& b, const ImageSize& size) {
  if (a.empty() && b.empty()) return {};
  const ImagePatch& p = a.empty() ? b : a;
  const ImagePatch& q = b.empty() ? a : b;
  ImagePatch both;
  both.x = std::max(0, std::min(p.x, q.x) - kSettlePx);
  both.y = std::max(0, std::min(p.y, q.y) - kSettlePx);
  both.width =
      std::min(static_cast<int>(size.width), std::max(p.x + p.width, q.x + q.width) + kSettlePx) -
      both.x;
  both.height = std::min(static_cast<int>(size.height),
                         std::max(p.y + p.height, q.y + q.height) + kSettlePx) -
                both.y;
  return both;
}

int Poisson(double mean, RandomStream* random) {
  if (mean > 50) {
    return std::max(0, static_cast<int>(std::lround(mean + std::sqrt(mean) * random->Gaussian())));
  }
  int count = 0;
  for (double left = random->Uniform(), limit = std::exp(-mean); left > limit; ++count) {
    left *= random->Uniform();
  }
  return count;
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
       const FrameRenderOptions& scene_options, const EventRenderOptions& event_options,
       RayGrid rays)
      : intrinsics(lens),
        size(image_size),
        scene(scene_options),
        options(event_options),
        light(scene_options),
        profile(scene_options.defocus_px, scene_options.defocus_disc_px),
        grid(std::move(rays)),
        imager(&intrinsics, size, &grid),
        led(Luminance(light.led_grey[0], light.led_grey[1], light.led_grey[2])),
        dark(std::max(1e-6f, led * kDarkShare)),
        clutter(size, options, RoomLight(size, scene, light, profile, dark), 0.5f * led + dark,
                &profile),
        pixels(size, options, std::log(std::max(led, dark))),
        readout(size.height, 1e-3 * options.row_ns, 1e-3 * options.event_ns),
        stamps(static_cast<size_t>(size.width) * size.height, 0),
        last_seen(stamps.size()) {
    sphere_options.radius_m = 0.5 * (target.diameter_m > 0 ? target.diameter_m : kDefaultDiameterM);
    sphere_options.limb = scene.limb;
    for (int k = 0; k < target.marker_count(); ++k) {
      Marker marker;
      const auto i = static_cast<size_t>(k);
      marker.position_m = target.marker_positions_m[i];
      marker.blink_hz = target.blink_hz.empty()
                            ? scene.blink_hz
                            : target.blink_hz[target.blink_hz.size() > 1 ? i : 0];
      marker.blink_hz *= 1 + 1e-6 * scene.blink_drift_ppm;
      markers.push_back(std::move(marker));
    }
    RandomStream draw({options.seed, 0x407});
    for (int i = 0; i < static_cast<int>(options.hot_pixels); ++i) {
      hot.push_back(static_cast<uint32_t>(draw.Uniform() * static_cast<double>(stamps.size())));
    }
    clutter_then = clutter_now = clutter.MomentAt(0);
    for (uint32_t y = 0; y < size.height; ++y) {
      for (uint32_t x = 0; x < size.width; ++x) {
        pixels.Settle(x, y, std::log(clutter.LightAt(x, y, clutter_now)));
      }
    }
  }

  bool IsLit(const Marker& marker, double time_s) const {
    if (marker.blink_hz <= 0) return true;
    const double turns = marker.blink_hz * time_s + options.led_phase;
    return turns - std::floor(turns) < scene.blink_duty;
  }

  absl::Status DrawSpheres(double time_s, const WandPath& path, bool after) {
    const std::optional<WandMotion> wand = path ? path(time_s) : std::nullopt;
    for (Marker& marker : markers) {
      SphereImage& image = after ? marker.after : marker.before;
      image.patch = {};
      if (!wand.has_value()) continue;
      SphereMotion sphere;
      sphere.centre_m = wand->Marker(marker.position_m).centre_m;
      if (!sphere.centre_m.allFinite()) {
        return absl::InvalidArgumentError(
            absl::StrCat("event renderer: the wand's pose at ", time_s, " s is not finite"));
      }
      const ExposurePart now{.dt_s = 0, .share = 1, .lit_share = 1};
      imager.Draw(sphere, {&now, 1}, profile, sphere_options, &image);
    }
    return absl::OkStatus();
  }

  // Steps of kStepUs, cut where the LED switches.
  void PlanSteps(Marker* marker) const {
    marker->steps.clear();
    const double begin_s = 1e-6 * static_cast<double>(now_us);
    std::vector<double> cuts;
    for (int64_t t = kStepUs; t <= kCellUs; t += kStepUs) cuts.push_back(static_cast<double>(t));
    if (marker->blink_hz > 0) {
      const double period_us = 1e6 / marker->blink_hz;
      const double turns = marker->blink_hz * begin_s + options.led_phase;
      for (double cycle = std::floor(turns);; ++cycle) {
        const double on_us = (cycle - turns) * period_us;
        if (on_us >= kCellUs) break;
        for (const double cut : {on_us, on_us + scene.blink_duty * period_us}) {
          if (cut > 0 && cut < kCellUs) cuts.push_back(cut);
        }
      }
    }
    std::sort(cuts.begin(), cuts.end());
    double from_us = 0;
    for (const double cut : cuts) {
      if (cut - from_us < 1e-3) continue;
      marker->steps.push_back({cut, IsLit(*marker, begin_s + 0.5e-6 * (from_us + cut))});
      from_us = cut;
    }
  }

  float SphereLight(const SphereImage& image, int x, int y, float behind, bool lit) const {
    const float cover = At(image.patch, image.cover, x, y);
    if (cover <= 0) return behind;
    float shine = (1 - cover) * behind + cover * (static_cast<float>(light.shell_grey) + dark);
    if (lit) shine += led * At(image.patch, image.lit, x, y);
    return shine;
  }

  // The marker that covers most of a pixel.
  const Marker& Owner(int x, int y, const Marker& first) const {
    const Marker* owner = &first;
    float most = -1;
    for (const Marker& marker : markers) {
      const float cover = At(marker.before.patch, marker.before.cover, x, y) +
                          At(marker.after.patch, marker.after.cover, x, y);
      if (cover > most && (cover > 0 || &marker == &first)) owner = &marker, most = cover;
    }
    return *owner;
  }

  bool Claim(int x, int y) {
    uint32_t& stamp = stamps[static_cast<size_t>(y) * size.width + static_cast<size_t>(x)];
    if (stamp == cell) return false;
    stamp = cell;
    return true;
  }

  void FollowSpheres() {
    for (const Marker& drawn : markers) {
      const ImagePatch& patch = drawn.patch;
      for (int y = patch.y; y < patch.y + patch.height; ++y) {
        for (int x = patch.x; x < patch.x + patch.width; ++x) {
          if (!Claim(x, y)) continue;
          const Marker& marker = Owner(x, y, drawn);
          const auto column = static_cast<uint32_t>(x), row = static_cast<uint32_t>(y);
          const float behind = clutter.LightAt(column, row, clutter_now);
          const float then = clutter.LightAt(column, row, clutter_then);
          PixelLight seen;
          seen.dark_begin = std::log(SphereLight(marker.before, x, y, behind, false));
          seen.lit_begin = std::log(SphereLight(marker.before, x, y, behind, true));
          seen.dark_end = std::log(SphereLight(marker.after, x, y, then, false));
          seen.lit_end = std::log(SphereLight(marker.after, x, y, then, true));
          if (now_us == 0) pixels.Settle(column, row, seen.dark_begin);
          pixels.Follow(column, row, seen, static_cast<double>(now_us), marker.steps, &requests);
        }
      }
    }
  }

  void FollowClutter() {
    const auto follow = [&](int x, int y) {
      if (!Claim(x, y)) return;
      const auto column = static_cast<uint32_t>(x), row = static_cast<uint32_t>(y);
      PixelLight seen;
      Seen& last = last_seen[static_cast<size_t>(y) * size.width + static_cast<size_t>(x)];
      if (last.cell == 0 || last.cell + 1 != cell)
        last.light = std::log(clutter.LightAt(column, row, clutter_now));
      seen.dark_begin = seen.lit_begin = last.light;
      seen.dark_end = seen.lit_end = std::log(clutter.LightAt(column, row, clutter_then));
      last = {cell, seen.dark_end};
      pixels.Follow(column, row, seen, static_cast<double>(now_us), plain_steps, &requests);
    };
    clutter.ForLamps(follow);
    clutter.ForBars(clutter_now, clutter_then, follow);
  }

  void MakeNoise() {
    RandomStream draw({options.seed, 0x9015e, static_cast<uint64_t>(now_us)});
    const auto fire = [&](uint32_t index, bool on) {
      pixels.Fire(index % size.width, index / size.width, on,
                  static_cast<double>(now_us) + draw.Uniform() * kCellUs, &requests);
    };
    const double cell_s = 1e-6 * kCellUs;
    const auto count = static_cast<double>(stamps.size());
    const auto anywhere = [&] { return static_cast<uint32_t>(draw.Uniform() * count); };
    for (int i = Poisson(options.background_hz * cell_s * count, &draw); i > 0; --i) {
      const uint32_t index = anywhere();
      fire(index, (draw.Bits() & 1) != 0);
    }
    for (int i = Poisson(options.leak_hz * cell_s * count, &draw); i > 0; --i) {
      fire(anywhere(), true);
    }
    for (const uint32_t index : hot) {
      for (int i = Poisson(options.hot_hz * cell_s, &draw); i > 0; --i) {
        fire(index, (draw.Bits() & 1) != 0);
      }
    }
  }

  absl::Status RenderCell(const WandPath& path, std::vector<SimulatedEvent>* events) {
    ++cell;
    const double begin_s = 1e-6 * static_cast<double>(now_us);
    const double end_s = 1e-6 * static_cast<double>(now_us + kCellUs);
    if (now_us == 0) RIGCAL_RETURN_IF_ERROR(DrawSpheres(begin_s, path, false));
    RIGCAL_RETURN_IF_ERROR(DrawSpheres(end_s, path, true));
    for (Marker& marker : markers) {
      marker.patch = Union(marker.before.patch, marker.after.patch, size);
      if (!marker.patch.empty()) PlanSteps(&marker);
    }
    clutter_then = clutter.MomentAt(end_s);
    MakeNoise();
    FollowSpheres();
    FollowClutter();
    readout.Read(&requests, static_cast<double>(now_us + kCellUs), events);
    for (Marker& marker : markers) std::swap(marker.before, marker.after);
    std::swap(clutter_now, clutter_then);
    now_us += kCellUs;
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
  FrameRenderOptions scene;
  EventRenderOptions options;
  LightModel light;
  EdgeProfile profile;
  RayGrid grid;
  SphereImager imager;
  float led, dark;
  SphereImageOptions sphere_options;
  EventClutter clutter;
  EventClutter::Moment clutter_now, clutter_then;
  EventPixels pixels;
  EventReadout readout;
  std::vector<uint32_t> stamps;  // cell in which a pixel was followed last
  uint32_t cell = 0;
  // What the clutter showed at the end of that cell.
  struct Seen {
    uint32_t cell = 0;
    float light = 0;
  };
  std::vector<Seen> last_seen;
  std::vector<Marker> markers;
  std::vector<uint32_t> hot;
  std::vector<PixelRequest> requests;
  const std::vector<LightStep> plain_steps = {{0.5 * kCellUs, false}, {1.0 * kCellUs, false}};
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

std::vector<MarkerTruth> EventRenderer::TruthOf(const WandMotion& wand) const {
  std::vector<SphereMotion> spheres;
  for (const Marker& marker : impl_->markers) spheres.push_back(wand.Marker(marker.position_m));
  return rigcal::TruthOf(impl_->intrinsics, impl_->size, spheres, impl_->sphere_options.radius_m,
                         nullptr);
}

bool EventRenderer::IsLit(int marker, double time_s) const {
  return impl_->IsLit(impl_->markers[static_cast<size_t>(marker)], time_s);
}

}  // namespace rigcal

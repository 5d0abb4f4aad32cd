// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/detection/rendered_room.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/simulation/frames/exposure_plan.h"
#include "common/simulation/frames/light_model.h"
#include "common/simulation/world/random_stream.h"
#include "common/status/status_macros.h"
#include "tests/accuracy/detection/photographs.h"

namespace rigcal::accuracy {
namespace {

constexpr uint64_t kMostTries = 64;
constexpr double kLitShare = 0.5;  // of the room's light on a sphere, by its LED
constexpr uint64_t kLedTimePurpose = 0x6c656474;

// A wand of which the border cuts a sphere, if `cut`; else one fully visible.
std::optional<WandMotion> PoseOf(const DetectionOptions& options, uint64_t seed) {
  const Intrinsics& intrinsics = *options.camera.intrinsics;
  const ImageSize& size = options.camera.image_size_px;
  if (!options.cut_by_border) {
    return RandomWandPose(intrinsics, size, options.target, options.pose, seed);
  }
  RandomWandPoseOptions pose = options.pose;
  for (uint64_t attempt = 0; attempt < kMostTries; ++attempt) {
    pose.margin_px = -12;
    auto wand = RandomWandPose(intrinsics, size, options.target, pose, kMostTries * seed + attempt);
    if (!wand) continue;
    for (size_t m = 0; m < options.target.marker_positions_m.size(); ++m) {
      const double share =
          testing::VisibleShare(intrinsics, size, options.target, *wand, m, nullptr);
      if (share > 0.2 && share < 0.9) return wand;
    }
  }
  return std::nullopt;
}

// When an LED's phase is drawn at all, for all of the wand's together.
std::optional<double> LedTime(const DetectionOptions& options, uint64_t seed) {
  if (!options.one_clock || options.target.blink_hz.empty()) return std::nullopt;
  RandomStream random{kLedTimePurpose, seed};
  return random.Uniform() / options.target.blink_hz.front();
}

bool IsLit(const DetectionOptions& options, double led_time_s) {
  const FrameRenderOptions& render = options.render;
  const BlinkTiming blink{options.target.blink_hz.front(), render.blink_duty, led_time_s};
  double lit_share = 0;
  for (const ExposurePart& part : PlanExposure(render.exposure_s, blink, render.exposure_s)) {
    lit_share += part.lit_share;
  }
  const LightModel light(render);
  const double led = lit_share * *std::max_element(light.led_grey.begin(), light.led_grey.end());
  return led >= kLitShare * (light.shell_grey + light.spot_grey);
}

}  // namespace

absl::StatusOr<RenderedRoom> RenderedRoom::Create(const DetectionOptions& options, int room) {
  FrameRenderOptions render = options.render;
  render.seed = options.seed * 1000 + static_cast<uint32_t>(room);
  std::vector<float> photograph;
  if (!options.photographs.empty()) {
    const size_t index = static_cast<size_t>(room) % options.photographs.size();
    photograph =
        LoadPhotograph(options.photographs[index], options.camera.image_size_px, render.seed);
  }
  RIGCAL_ASSIGN_OR_RETURN(
      SceneRenderer renderer,
      SceneRenderer::Create(*options.camera.intrinsics, options.camera.image_size_px,
                            options.target, render, photograph.empty() ? nullptr : &photograph));
  return RenderedRoom(options, std::move(renderer), render.seed);
}

absl::StatusOr<RoomFrame> RenderedRoom::Render(int frame) {
  RoomFrame shown;
  SceneFrame scene;
  shown.seed = scene.seed = static_cast<uint64_t>(seed_) * 100000 + static_cast<uint64_t>(frame);
  const bool empty = std::fmod((frame + 1) * options_.share_without_wand, 1.0) <
                     options_.share_without_wand - 1e-9;
  if (options_.with_wand && !empty) {
    shown.wand = PoseOf(options_, scene.seed);
    if (shown.wand) {
      scene.spheres = shown.wand->Spheres(options_.target);
      scene.led_time_s = LedTime(options_, scene.seed);
    }
  }
  shown.lit = !scene.led_time_s || IsLit(options_, *scene.led_time_s);
  RIGCAL_ASSIGN_OR_RETURN(shown.truth, renderer_.Render(scene, pixels_));
  return shown;
}

agent::ImageView RenderedRoom::view() const {
  const ImageSize& size = options_.camera.image_size_px;
  return {pixels_.data(), static_cast<int>(size.width), static_cast<int>(size.height),
          static_cast<ptrdiff_t>(size.width) * 3, agent::PixelFormat::kBgr8};
}

}  // namespace rigcal::accuracy

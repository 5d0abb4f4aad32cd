// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/scene_renderer.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <numeric>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/simulation/frames/room_background.h"
#include "common/simulation/world/random_stream.h"
#include "common/simulation/world/simulated_world.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

constexpr uint64_t kFramePurpose = 0x6672616d65;
constexpr double kLongestStepPx = 0.4;  // of a sphere's image between two parts of an exposure
constexpr double kMostSteps = 1000;     // bounds the work where the motion is absurd
constexpr double kFloorBlurPx = 2;      // a floor is no mirror

SphereMotion MirroredIn(const Eigen::Vector4d& floor, const SphereMotion& sphere) {
  const Eigen::Vector3d normal = floor.head<3>();
  const auto turn = [&](const Eigen::Vector3d& v) -> Eigen::Vector3d {
    return v - 2 * normal.dot(v) * normal;
  };
  return {turn(sphere.centre_m) + 2 * floor.w() * normal, turn(sphere.velocity_m_s),
          turn(sphere.acceleration_m_s2)};
}

bool IsFinite(const SphereMotion& sphere) {
  return sphere.centre_m.allFinite() && sphere.velocity_m_s.allFinite() &&
         sphere.acceleration_m_s2.allFinite();
}

}  // namespace

absl::StatusOr<SceneRenderer> SceneRenderer::Create(const Intrinsics& intrinsics,
                                                    const ImageSize& image_size,
                                                    const Target& target,
                                                    const FrameRenderOptions& options) {
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  RIGCAL_RETURN_IF_ERROR(image_size.Validate());
  RIGCAL_RETURN_IF_ERROR(intrinsics.Validate(image_size));
  RIGCAL_RETURN_IF_ERROR(target.Validate());
  if (std::min(image_size.width, image_size.height) < 2 ||
      uint64_t{image_size.width} * image_size.height > (uint64_t{1} << 27)) {
    return absl::InvalidArgumentError(absl::StrCat("an image of ", image_size.width, "x",
                                                   image_size.height,
                                                   " px cannot be drawn, 2x2 to 134 Mpx can"));
  }
  RIGCAL_ASSIGN_OR_RETURN(SphereImager imager, SphereImager::Create(intrinsics, image_size));
  return SceneRenderer(std::move(imager), target, options);
}

SceneRenderer::SceneRenderer(SphereImager imager, const Target& target,
                             const FrameRenderOptions& options)
    : imager_(std::move(imager)),
      target_(target),
      options_(options),
      light_(options),
      profile_(options.defocus_px, options.defocus_disc_px),
      floor_profile_(std::hypot(options.defocus_px, kFloorBlurPx), options.defocus_disc_px),
      canvas_(imager_.image_size(), options, light_,
              RenderRoom(imager_.image_size(), options, light_, profile_)) {}

void SceneRenderer::DrawSphere(const SceneFrame& frame, size_t marker, const SphereMotion& sphere,
                               const EdgeProfile& blur, SphereLight its_light) {
  Eigen::Vector2d ends[2];
  double travel_px = 0;
  const double exposure_s = options_.exposure_s, half_s = 0.5 * exposure_s;
  if (ImageOf(imager_.intrinsics(), sphere.centre_m - half_s * sphere.velocity_m_s, &ends[0]) &&
      ImageOf(imager_.intrinsics(), sphere.centre_m + half_s * sphere.velocity_m_s, &ends[1])) {
    travel_px = (ends[1] - ends[0]).norm();
  } else {
    travel_px = 1000 * exposure_s * sphere.velocity_m_s.norm() / sphere.centre_m.norm();
  }
  // A sphere that stands still is drawn once.
  const double steps =
      travel_px < 0.02 ? 1 : std::clamp(travel_px / kLongestStepPx, 2.0, kMostSteps);
  BlinkTiming blink{BlinkHz(target_, options_, marker), options_.blink_duty, 0};
  RandomStream random{options_.seed, kFramePurpose, frame.seed, 1, marker};
  if (blink.hz > 0) blink.phase_s = frame.led_time_s.value_or(random.Uniform() / blink.hz);
  const auto parts = PlanExposure(exposure_s, blink, 1.0001 * exposure_s / steps);
  for (const ExposurePart& part : parts) its_light.lit_share += part.lit_share;
  const SphereImageOptions how{SphereRadiusM(target_), options_.limb,
                               its_light.halo > 0 ? options_.bloom_radius_px : 0};
  if (imager_.Draw(sphere, parts, blur, how, &sphere_image_)) {
    canvas_.AddSphere(sphere_image_, its_light);
  }
}

// A bar over one of the markers in the image, in a share of the frames: it covers some part of the
// marker's disc, from a sliver to the whole of it.
std::optional<OccludingBar> SceneRenderer::BarOf(const SceneFrame& frame,
                                                 std::span<const MarkerGroundTruth> markers) const {
  RandomStream random{options_.seed, kFramePurpose, frame.seed, 2};
  if (markers.empty() || random.Uniform() >= options_.occlusion) return std::nullopt;
  const MarkerGroundTruth& occluded =
      markers[static_cast<size_t>(random.Uniform() * static_cast<double>(markers.size()))];
  if (!occluded.inside) return std::nullopt;
  const double radius_px = occluded.radius_px;
  OccludingBar bar;
  const double angle = random.Uniform(0, 2 * std::numbers::pi);
  bar.normal = {std::cos(angle), std::sin(angle)};
  bar.half_width_px = std::max(1.5, radius_px * random.Uniform(0.2, 1.8));
  bar.half_length_px = std::max(20.0, radius_px * random.Uniform(3, 8));
  // Its edge lies somewhere on the disc.
  const double edge_px = radius_px * random.Uniform(-0.9, 0.9);
  bar.centre_px = occluded.centre_px + (edge_px + bar.half_width_px) * bar.normal;
  bar.reflectance = random.Uniform(0.03, 0.4);
  return bar;
}

absl::StatusOr<FrameGroundTruth> SceneRenderer::Render(const SceneFrame& frame,
                                                       std::span<uint8_t> bgr) {
  const std::vector<SphereMotion>& spheres = frame.spheres;
  if (bgr.size() != buffer_size()) {
    return absl::InvalidArgumentError(absl::StrCat("the image's buffer has ", bgr.size(),
                                                   " bytes, it must have ", buffer_size()));
  }
  if (!spheres.empty() && spheres.size() != target_.marker_positions_m.size()) {
    return absl::InvalidArgumentError(absl::StrCat("the motion of ", spheres.size(),
                                                   " spheres is given, the target has ",
                                                   target_.marker_positions_m.size()));
  }
  if (!std::ranges::all_of(spheres, IsFinite)) {
    return absl::InvalidArgumentError("the wand's motion is not finite");
  }
  FrameGroundTruth truth;
  for (const SphereMotion& sphere : spheres) {
    truth.markers.push_back(TruthOf(imager_.intrinsics(), imager_.image_size(), sphere.centre_m,
                                    SphereRadiusM(target_)));
  }
  truth.bar = BarOf(frame, truth.markers);
  if (options_.reflection > 0) {
    SphereLight mirrored{light_.led_grey, 0, 0, 0, 0};
    for (double& grey : mirrored.led) grey *= options_.reflection;
    for (size_t m = 0; m < spheres.size(); ++m) {
      DrawSphere(frame, m, MirroredIn(frame.floor, spheres[m]), floor_profile_, mirrored);
    }
  }
  std::vector<size_t> far_first(spheres.size());
  std::iota(far_first.begin(), far_first.end(), size_t{0});
  std::ranges::stable_sort(far_first, std::greater(),
                           [&](size_t m) { return spheres[m].centre_m.norm(); });
  for (const size_t m : far_first) {
    DrawSphere(frame, m, spheres[m], profile_,
               {light_.led_grey, light_.shell_grey, 1, options_.bloom, 0});
  }
  if (truth.bar) canvas_.AddBar(*truth.bar, profile_);
  canvas_.Expose(RandomStream{options_.seed, kFramePurpose, frame.seed}.Bits(), bgr);
  canvas_.Reset();
  return truth;
}

}  // namespace rigcal

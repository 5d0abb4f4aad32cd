// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/scene_renderer.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/simulation/frames/edge_profile.h"
#include "common/simulation/frames/light_model.h"
#include "common/simulation/frames/occluding_bar.h"
#include "common/simulation/frames/ray_grid.h"
#include "common/simulation/frames/room_background.h"
#include "common/simulation/frames/scene_canvas.h"
#include "common/simulation/frames/scene_ground_truth.h"
#include "common/simulation/frames/sphere_image.h"
#include "common/simulation/world/random_stream.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

constexpr uint64_t kFramePurpose = 0x6672616d65;
constexpr double kUsualDiameterM = 0.04;
constexpr double kLongestStepPx = 0.4;  // of a sphere's image between two parts of an exposure
constexpr double kMostSteps = 1000;     // bounds the work where the motion is absurd
constexpr double kFloorBlurPx = 2;      // a floor is no mirror

double BlinkHz(const Target& target, const FrameRenderOptions& options, size_t marker) {
  if (target.blink_hz.empty()) return options.blink_hz;
  return target.blink_hz[std::min(marker, target.blink_hz.size() - 1)];
}

// A glossy surface beside the wand: a table, a cupboard. Its mirror images are seen next to the
// wand, and no sphere is in it.
Eigen::Vector4d SurfaceBeside(std::span<const SphereMotion> spheres, RandomStream random) {
  const Eigen::Vector3d middle = 0.5 * (spheres.front().centre_m + spheres.back().centre_m);
  const Eigen::Vector3d sight = middle.normalized();
  const double turn = random.Uniform(0, 2 * std::numbers::pi);
  const Eigen::Vector3d across = sight.unitOrthogonal();
  const Eigen::Vector3d beside = std::cos(turn) * across + std::sin(turn) * sight.cross(across);
  const Eigen::Vector3d normal = (beside - random.Uniform(0, 0.4) * sight).normalized();
  const double reach_m = std::abs(normal.dot(spheres.front().centre_m - middle));
  const double offset_m = normal.dot(middle) - reach_m - random.Uniform(0.08, 0.3);
  return {normal.x(), normal.y(), normal.z(), offset_m};
}

SphereMotion MirroredIn(const Eigen::Vector4d& floor, const SphereMotion& sphere) {
  const Eigen::Vector3d normal = floor.head<3>();
  const auto turn = [&](const Eigen::Vector3d& v) -> Eigen::Vector3d {
    return v - 2 * normal.dot(v) * normal;
  };
  return {turn(sphere.centre_m) + 2 * floor.w() * normal, turn(sphere.velocity_m_s),
          turn(sphere.acceleration_m_s2)};
}

bool IsFinite(std::span<const SphereMotion> spheres) {
  return std::all_of(spheres.begin(), spheres.end(), [](const SphereMotion& sphere) {
    return sphere.centre_m.allFinite() && sphere.velocity_m_s.allFinite() &&
           sphere.acceleration_m_s2.allFinite();
  });
}

}  // namespace

SphereMotion WandMotion::Marker(double position_m) const {
  const Eigen::Vector3d arm = position_m * direction;
  const Eigen::Vector3d turning = angular_velocity_rad_s.cross(arm);
  return {origin_m + arm, velocity_m_s + turning, angular_velocity_rad_s.cross(turning)};
}

bool FrameGroundTruth::WandVisible(double min_share) const {
  return !markers.empty() &&
         std::all_of(markers.begin(), markers.end(), [&](const MarkerGroundTruth& marker) {
           return marker.inside && marker.visible_share >= min_share;
         });
}

struct SceneRenderer::Impl {
  Impl(const Intrinsics& intrinsics_in, const ImageSize& size_in, const Target& target_in,
       const FrameRenderOptions& options_in, RayGrid rays_in)
      : intrinsics(intrinsics_in),
        size(size_in),
        target(target_in),
        options(options_in),
        radius_m(0.5 * (target_in.diameter_m > 0 ? target_in.diameter_m : kUsualDiameterM)),
        light(options_in),
        rays(std::move(rays_in)),
        profile(options_in.defocus_px, options_in.defocus_disc_px),
        floor_profile(std::hypot(options_in.defocus_px, kFloorBlurPx), options_in.defocus_disc_px),
        imager(&intrinsics, size_in, &rays),
        canvas(size_in, options_in, light, RenderRoom(size_in, options_in, light, profile)) {}

  BlinkTiming Blink(const SceneFrame& frame, size_t marker) const {
    BlinkTiming blink{BlinkHz(target, options, marker), options.blink_duty, 0};
    RandomStream random{options.seed, kFramePurpose, frame.seed, 1, marker};
    if (blink.hz > 0) blink.phase_s = frame.led_time_s.value_or(random.Uniform() / blink.hz);
    return blink;
  }

  // Returns the share of the exposure during which the LED shone.
  double DrawSphere(const SceneFrame& frame, size_t marker, const SphereMotion& sphere,
                    const EdgeProfile& blur, SphereLight its_light) {
    Eigen::Vector2d ends[2];
    double travel_px = 0;
    const double half_s = 0.5 * options.exposure_s;
    if (ImageOf(intrinsics, sphere.centre_m - half_s * sphere.velocity_m_s, &ends[0]) &&
        ImageOf(intrinsics, sphere.centre_m + half_s * sphere.velocity_m_s, &ends[1])) {
      travel_px = (ends[1] - ends[0]).norm();
    } else {
      travel_px = 1000 * options.exposure_s * sphere.velocity_m_s.norm() / sphere.centre_m.norm();
    }
    // A sphere that stands still is drawn once.
    const double steps =
        travel_px < 0.02 ? 1 : std::clamp(travel_px / kLongestStepPx, 2.0, kMostSteps);
    const auto parts =
        PlanExposure(options.exposure_s, Blink(frame, marker), 1.0001 * options.exposure_s / steps);
    for (const ExposurePart& part : parts) its_light.lit_share += part.lit_share;
    const SphereImageOptions how{radius_m, options.limb,
                                 its_light.halo > 0 ? options.bloom_radius_px : 0};
    if (imager.Draw(sphere, parts, blur, how, &sphere_image)) {
      canvas.AddSphere(sphere_image, its_light);
    }
    return its_light.lit_share;
  }

  void DrawReflections(const SceneFrame& frame, std::span<const SphereMotion> spheres) {
    const Eigen::Vector4d floor = frame.floor.value_or(
        SurfaceBeside(spheres, RandomStream{options.seed, kFramePurpose, frame.seed, 3}));
    SphereLight mirrored{light.led_grey, 0, 0, 0, 0};
    for (double& grey : mirrored.led) grey *= options.reflection;
    for (size_t m = 0; m < spheres.size(); ++m) {
      DrawSphere(frame, m, MirroredIn(floor, spheres[m]), floor_profile, mirrored);
    }
  }

  // Far ones first; returns the lit share of marker 0.
  double DrawSpheres(const SceneFrame& frame, std::span<const SphereMotion> spheres) {
    std::vector<size_t> order(spheres.size());
    for (size_t m = 0; m < order.size(); ++m) order[m] = m;
    std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
      return spheres[a].centre_m.norm() > spheres[b].centre_m.norm();
    });
    double lit_share = 0;
    for (const size_t m : order) {
      const double share = DrawSphere(frame, m, spheres[m], profile,
                                      {light.led_grey, light.shell_grey, 1, options.bloom, 0});
      if (m == 0) lit_share = share;
    }
    return lit_share;
  }

  // A bar over one of the markers in the image, in a share of the frames.
  std::optional<OccludingBar> BarOf(const SceneFrame& frame,
                                    std::span<const MarkerGroundTruth> markers) const {
    RandomStream random{options.seed, kFramePurpose, frame.seed, 2};
    if (markers.empty() || random.Uniform() >= options.occlusion) return std::nullopt;
    const MarkerGroundTruth& occluded =
        markers[static_cast<size_t>(random.Uniform() * static_cast<double>(markers.size()))];
    if (!occluded.inside) return std::nullopt;
    return RandomBar(occluded.centre_px, occluded.radius_px, &random);
  }

  FrameGroundTruth Draw(const SceneFrame& frame, std::span<const SphereMotion> spheres) {
    FrameGroundTruth truth;
    if (spheres.empty()) return truth;
    truth.markers = TruthOf(intrinsics, size, spheres, radius_m, nullptr);
    const auto bar = BarOf(frame, truth.markers);
    if (bar) truth.markers = TruthOf(intrinsics, size, spheres, radius_m, &*bar);
    if (options.reflection > 0) DrawReflections(frame, spheres);
    truth.lit_share = DrawSpheres(frame, spheres);
    if (bar) canvas.AddBar(*bar, profile);
    return truth;
  }

  const Intrinsics intrinsics;
  const ImageSize size;
  const Target target;
  const FrameRenderOptions options;
  const double radius_m;
  const LightModel light;
  const RayGrid rays;
  const EdgeProfile profile;
  const EdgeProfile floor_profile;
  SphereImager imager;
  SceneCanvas canvas;
  SphereImage sphere_image;
};

SceneRenderer::SceneRenderer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
SceneRenderer::SceneRenderer(SceneRenderer&&) noexcept = default;
SceneRenderer& SceneRenderer::operator=(SceneRenderer&&) noexcept = default;
SceneRenderer::~SceneRenderer() = default;

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
  RIGCAL_ASSIGN_OR_RETURN(RayGrid rays, RayGrid::Create(intrinsics, image_size));
  return SceneRenderer(
      std::make_unique<Impl>(intrinsics, image_size, target, options, std::move(rays)));
}

size_t SceneRenderer::buffer_size() const { return impl_->canvas.size(); }
const ImageSize& SceneRenderer::image_size() const { return impl_->size; }
const FrameRenderOptions& SceneRenderer::options() const { return impl_->options; }

absl::StatusOr<FrameGroundTruth> SceneRenderer::Render(const SceneFrame& frame,
                                                       std::span<uint8_t> bgr) {
  std::vector<SphereMotion> spheres;
  if (frame.wand) {
    for (const double position_m : impl_->target.marker_positions_m) {
      spheres.push_back(frame.wand->Marker(position_m));
    }
  }
  return Render(frame, spheres, bgr);
}

absl::StatusOr<FrameGroundTruth> SceneRenderer::Render(const SceneFrame& frame,
                                                       std::span<const SphereMotion> spheres,
                                                       std::span<uint8_t> bgr) {
  if (bgr.size() != buffer_size()) {
    return absl::InvalidArgumentError(absl::StrCat("the image's buffer has ", bgr.size(),
                                                   " bytes, it must have ", buffer_size()));
  }
  if (!spheres.empty() && spheres.size() != impl_->target.marker_positions_m.size()) {
    return absl::InvalidArgumentError(absl::StrCat("the motion of ", spheres.size(),
                                                   " spheres is given, the target has ",
                                                   impl_->target.marker_positions_m.size()));
  }
  if (!IsFinite(spheres)) {
    return absl::InvalidArgumentError("the wand's motion is not finite");
  }
  FrameGroundTruth truth = impl_->Draw(frame, spheres);
  impl_->canvas.Expose(RandomStream{impl_->options.seed, kFramePurpose, frame.seed}.Bits(), bgr);
  impl_->canvas.Reset();
  return truth;
}

}  // namespace rigcal

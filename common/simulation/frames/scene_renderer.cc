// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/scene_renderer.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <numeric>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/simulation/frames/camera_output.h"
#include "common/simulation/frames/room_background.h"
#include "common/simulation/world/random_stream.h"
#include "common/simulation/world/simulated_world.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

constexpr uint64_t kFramePurpose = 0x6672616d65;
constexpr uint64_t kLedPurpose = 0x6c6564;
constexpr double kHandleM = 0.3;        // of the stick beyond the first sphere
constexpr int kMostPlaces = 32;         // of a stick during an exposure
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
                                                    const FrameRenderOptions& options,
                                                    const std::vector<float>* photograph) {
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
  return SceneRenderer(std::move(imager), target, options, photograph);
}

SceneRenderer::SceneRenderer(SphereImager imager, const Target& target,
                             const FrameRenderOptions& options,
                             const std::vector<float>* photograph)
    : imager_(std::move(imager)),
      target_(target),
      options_(options),
      light_(options),
      profile_(options.defocus_px, options.defocus_disc_px),
      floor_profile_(std::hypot(options.defocus_px, kFloorBlurPx), options.defocus_disc_px),
      canvas_(imager_.image_size(), options, light_,
              RenderRoom(imager_.image_size(), options, light_, profile_, photograph)) {}

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
  BlinkTiming blink{BlinkHz(target_, options_, marker), options_.blink_duty, 0,
                    SentCodeOf(options_, target_, marker)};
  RandomStream random{options_.seed, kFramePurpose, frame.seed, 1, marker};
  if (blink.hz > 0) blink.phase_s = frame.led_time_s.value_or(random.Uniform() / blink.hz);
  const RowTiming timing{1e-6 * options_.line_delay_us, MiddleRow(), [&](double delay_s) {
                           BlinkTiming later = blink;
                           later.phase_s += delay_s;
                           return PlanExposure(exposure_s, later, 1.0001 * exposure_s / steps);
                         }};
  for (const ExposurePart& part : timing.parts_after(0)) its_light.lit_share += part.lit_share;
  SphereImageOptions how{SphereRadiusM(target_), options_.limb,
                         its_light.halo > 0 ? options_.bloom_radius_px : 0};
  if (options_.led_gradient > 0) {
    how.led_gradient =
        options_.led_gradient *
        (frame.spheres.back().centre_m - frame.spheres.front().centre_m).normalized();
  }
  if (its_light.spot > 0) how.spot_direction = frame.up;
  if (options_.led_uneven > 0) {
    RandomStream of_led{options_.seed, kLedPurpose, marker};
    const double share = 1 + options_.led_uneven * of_led.Uniform(-1, 1);
    for (double& grey : its_light.led) grey *= share;
  }
  if (imager_.Draw(sphere, timing, blur, how, &sphere_image_)) {
    canvas_.AddSphere(sphere_image_, its_light);
  }
}

// A sphere at the time at which the row of its centre is exposed.
SphereMotion SceneRenderer::AtItsRow(const SphereMotion& sphere) const {
  SphereMotion moved = sphere;
  if (options_.line_delay_us == 0) return moved;
  for (int round = 0; round < 4; ++round) {
    Eigen::Vector2d pixel;
    if (!ImageOf(imager_.intrinsics(), moved.centre_m, &pixel)) return sphere;
    const double dt_s = 1e-6 * options_.line_delay_us * (pixel.y() - MiddleRow());
    moved.centre_m =
        sphere.centre_m + dt_s * sphere.velocity_m_s + 0.5 * dt_s * dt_s * sphere.acceleration_m_s2;
  }
  return moved;
}

// The stick through the spheres, its handle, and the hand that holds it, with the light of the room
// and from above.
void SceneRenderer::DrawStick(const SceneFrame& frame) {
  if (!(options_.rod_m > 0) || frame.spheres.size() < 2) return;
  RandomStream random{options_.seed, kLedPurpose};
  const double lux = options_.lux + 0.5 * options_.overhead_lux;
  const double white_grey = light_.grey_per_cd_m2 * lux / std::numbers::pi;
  const auto coloured = [&](double hue_deg, double saturation, double reflectance) {
    Bgr colour = HueColour(hue_deg, saturation);
    for (double& channel : colour) channel *= white_grey * reflectance;
    return colour;
  };
  const Bgr stick =
      coloured(random.Uniform(20, 40), random.Uniform(0, 0.6), random.Uniform(0.04, 0.6));
  const Bgr skin =
      coloured(random.Uniform(14, 28), random.Uniform(0.3, 0.6), random.Uniform(0.15, 0.6));
  const Bgr sleeve =
      coloured(random.Uniform(0, 360), random.Uniform(0, 0.9), random.Uniform(0.05, 0.6));
  const Eigen::Vector3d wobble(random.Gaussian(), random.Gaussian(), random.Gaussian());
  std::vector<StickImage> sticks, hands, sleeves;
  const auto place = [&](const Eigen::Vector3d& begin_m, const Eigen::Vector3d& end_m,
                         double diameter_m, std::vector<StickImage>* places) {
    StickImage image;
    if (begin_m.z() < 0.1 || end_m.z() < 0.1 ||
        !ImageOf(imager_.intrinsics(), begin_m, &image.begin_px) ||
        !ImageOf(imager_.intrinsics(), end_m, &image.end_px)) {
      return;
    }
    image.begin_half_px = 0.5 * diameter_m * imager_.intrinsics().fx_px / begin_m.norm();
    image.end_half_px = 0.5 * diameter_m * imager_.intrinsics().fx_px / end_m.norm();
    places->push_back(image);
  };
  const SphereMotion first = AtItsRow(frame.spheres.front()), last = AtItsRow(frame.spheres.back());
  const double travel_px = options_.exposure_s * imager_.intrinsics().fx_px *
                           std::max(first.velocity_m_s.norm(), last.velocity_m_s.norm()) /
                           first.centre_m.norm();
  const int count = std::clamp(static_cast<int>(travel_px), 1, kMostPlaces);
  for (int i = 0; i < count; ++i) {
    const double dt_s = options_.exposure_s * ((i + 0.5) / count - 0.5);
    const Eigen::Vector3d from_m = first.centre_m + dt_s * first.velocity_m_s;
    const Eigen::Vector3d to_m = last.centre_m + dt_s * last.velocity_m_s;
    const Eigen::Vector3d along = (from_m - to_m).normalized();
    const Eigen::Vector3d grip_m = from_m + kHandleM * along;
    place(grip_m, to_m, options_.rod_m, &sticks);
    if (!options_.held) continue;
    const Eigen::Vector3d down = (along - frame.up + 0.4 * wobble).normalized();
    place(grip_m - 0.09 * along, grip_m, 0.06, &hands);
    place(grip_m + 0.05 * down, grip_m + 0.45 * down, 0.09, &sleeves);
  }
  canvas_.AddStick(sleeves, sleeve, profile_);
  canvas_.AddStick(sticks, stick, profile_);
  canvas_.AddStick(hands, skin, profile_);
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
    truth.markers.push_back(TruthOf(imager_.intrinsics(), imager_.image_size(),
                                    AtItsRow(sphere).centre_m, SphereRadiusM(target_)));
  }
  truth.bar = BarOf(frame, truth.markers);
  if (options_.reflection > 0) {
    SphereLight mirrored{.led = light_.led_grey, .cover = 0};
    for (double& grey : mirrored.led) grey *= options_.reflection;
    for (size_t m = 0; m < spheres.size(); ++m) {
      DrawSphere(frame, m, MirroredIn(frame.floor, spheres[m]), floor_profile_, mirrored);
    }
  }
  DrawStick(frame);
  std::vector<size_t> far_first(spheres.size());
  std::iota(far_first.begin(), far_first.end(), size_t{0});
  std::ranges::stable_sort(far_first, std::greater(),
                           [&](size_t m) { return spheres[m].centre_m.norm(); });
  for (const size_t m : far_first) {
    DrawSphere(frame, m, spheres[m], profile_,
               {.led = light_.led_grey,
                .shell = light_.shell_grey,
                .spot = light_.spot_grey,
                .halo = options_.bloom});
  }
  if (truth.bar) canvas_.AddBar(*truth.bar, profile_);
  canvas_.Expose(RandomStream{options_.seed, kFramePurpose, frame.seed}.Bits(), bgr);
  canvas_.Reset();
  if (options_.bayer) ApplyBayer(imager_.image_size(), bgr);
  if (options_.jpeg_quality >= 1) {
    ApplyJpegLoss(imager_.image_size(), static_cast<int>(options_.jpeg_quality), bgr);
  }
  return truth;
}

}  // namespace rigcal

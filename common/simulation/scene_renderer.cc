// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/scene_renderer.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/simulation/edge_profile.h"
#include "common/simulation/light_model.h"
#include "common/simulation/occluding_bar.h"
#include "common/simulation/random_stream.h"
#include "common/simulation/ray_grid.h"
#include "common/simulation/room_background.h"
#include "common/simulation/scene_truth.h"
#include "common/simulation/sensor_noise.h"
#include "common/simulation/sphere_image.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

constexpr uint64_t kFramePurpose = 0x6672616d65;
constexpr double kUsualDiameterM = 0.04;
constexpr double kUsualFloorM = 1.3;
constexpr double kLongestStepPx = 0.4;  // of a sphere's image between two parts of an exposure
constexpr double kFloorBlurPx = 2;      // a floor is no mirror

double BlinkHz(const Target& target, const FrameRenderOptions& options, size_t marker) {
  if (target.blink_hz.empty()) return options.blink_hz;
  return target.blink_hz[std::min(marker, target.blink_hz.size() - 1)];
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

// The LED's colour dims with its own share; none of it casts light on the room.
struct SphereLight {
  Bgr led{};         // grey of a pixel lit during the whole exposure
  double shell = 0;  // grey of the ambient light on it
  double cover = 1;  // how much of what is behind it goes: 0 for a mirror image
  double halo = 0;   // of `led` times the share lit, at the rim
};

}  // namespace

SphereMotion WandMotion::Marker(double position_m) const {
  const Eigen::Vector3d arm = position_m * direction;
  const Eigen::Vector3d turning = angular_velocity_rad_s.cross(arm);
  return {origin_m + arm, velocity_m_s + turning, angular_velocity_rad_s.cross(turning)};
}

bool FrameTruth::WandVisible(double min_share) const {
  return !markers.empty() &&
         std::all_of(markers.begin(), markers.end(), [&](const MarkerTruth& marker) {
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
        noise(options_in.read_noise_grey, options_in.electrons_per_grey),
        imager(&intrinsics, size_in, &rays),
        scene(RenderRoom(size_in, options_in, light, profile)),
        sigma(scene.size()) {
    noise.Sigma(scene, sigma);
  }

  size_t PixelIndex(int x, int y) const {
    return 3 * (static_cast<size_t>(y) * size.width + static_cast<size_t>(x));
  }
  std::span<int16_t> PatchRow(const ImagePatch& patch, int row) {
    return {&scene[PixelIndex(patch.x, patch.y + row)], 3 * static_cast<size_t>(patch.width)};
  }

  // Keeps what is behind a patch, for Restore.
  void Keep(const ImagePatch& patch) {
    kept_patches.push_back(patch);
    for (int row = 0; row < patch.height; ++row) {
      const auto pixels = PatchRow(patch, row);
      kept.insert(kept.end(), pixels.begin(), pixels.end());
    }
  }
  void UpdateSigma(const ImagePatch& patch) {
    for (int row = 0; row < patch.height; ++row) {
      const auto pixels = PatchRow(patch, row);
      noise.Sigma(pixels, {&sigma[PixelIndex(patch.x, patch.y + row)], pixels.size()});
    }
  }
  // Takes the wand out of the room again, last patch first: they may overlap.
  void Restore() {
    for (; !kept_patches.empty(); kept_patches.pop_back()) {
      const ImagePatch& patch = kept_patches.back();
      for (int row = patch.height - 1; row >= 0; --row) {
        const auto pixels = PatchRow(patch, row);
        std::copy(kept.end() - static_cast<ptrdiff_t>(pixels.size()), kept.end(), pixels.begin());
        kept.resize(kept.size() - pixels.size());
      }
      UpdateSigma(patch);
    }
  }

  double Passed(int x, int y) const { return VignettingAt(size, options.vignetting, x, y); }

  void Blend(const SphereImage& sphere, const SphereLight& its_light, double lit_share) {
    Keep(sphere.patch);
    size_t i = 0;
    for (int row = 0; row < sphere.patch.height; ++row) {
      int16_t* pixel = PatchRow(sphere.patch, row).data();
      for (int column = 0; column < sphere.patch.width; ++column, ++i, pixel += 3) {
        const double cover = its_light.cover * static_cast<double>(sphere.cover[i]);
        const double lit = static_cast<double>(sphere.lit[i]) +
                           its_light.halo * lit_share * static_cast<double>(sphere.halo[i]);
        if (cover <= 0 && lit <= 0) continue;
        const double passed = Passed(sphere.patch.x + column, sphere.patch.y + row);
        const double shell = options.black_grey + passed * its_light.shell;
        for (size_t channel = 0; channel < 3; ++channel) {
          const double behind = static_cast<double>(pixel[channel]) / kLinearPerGrey;
          pixel[channel] = ToLinear((1 - cover) * behind + cover * shell +
                                    lit * passed * its_light.led[channel]);
        }
      }
    }
    UpdateSigma(sphere.patch);
  }

  BlinkTiming Blink(const SceneFrame& frame, size_t marker) const {
    BlinkTiming blink{BlinkHz(target, options, marker), options.blink_duty, 0};
    RandomStream random{options.seed, kFramePurpose, frame.seed, 1, marker};
    if (blink.hz > 0) blink.phase_s = frame.led_time_s.value_or(random.Uniform() / blink.hz);
    return blink;
  }

  // Returns the share of the exposure during which the LED shone.
  double DrawSphere(const SceneFrame& frame, size_t marker, const SphereMotion& sphere,
                    const EdgeProfile& blur, const SphereLight& its_light) {
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
    const double steps = travel_px < 0.02 ? 1 : std::max(2.0, travel_px / kLongestStepPx);
    const auto parts =
        PlanExposure(options.exposure_s, Blink(frame, marker), 1.0001 * options.exposure_s / steps);
    double lit_share = 0;
    for (const ExposurePart& part : parts) lit_share += part.lit_share;
    const SphereImageOptions how{radius_m, options.limb,
                                 its_light.halo > 0 ? options.bloom_radius_px : 0};
    if (imager.Draw(sphere, parts, blur, how, &sphere_image)) {
      Blend(sphere_image, its_light, lit_share);
    }
    return lit_share;
  }

  void DrawReflections(const SceneFrame& frame, std::span<const SphereMotion> spheres) {
    const Eigen::Vector4d floor = frame.floor.value_or(Eigen::Vector4d(0, 1, 0, kUsualFloorM));
    SphereLight mirrored{light.led_grey, 0, 0, 0};
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
                                      {light.led_grey, light.shell_grey, 1, options.bloom});
      if (m == 0) lit_share = share;
    }
    return lit_share;
  }

  void DrawBar(const OccludingBar& bar) {
    const double reach =
        std::hypot(bar.half_width_px, bar.half_length_px) + static_cast<double>(profile.reach_px());
    const Eigen::Array2d last(size.width - 1.0, size.height - 1.0);
    const Eigen::Array2d low = (bar.centre_px.array() - reach).max(0.0).min(last);
    const Eigen::Array2d high = (bar.centre_px.array() + reach).max(0.0).min(last);
    const ImagePatch patch{static_cast<int>(low.x()), static_cast<int>(low.y()),
                           static_cast<int>(high.x()) - static_cast<int>(low.x()) + 1,
                           static_cast<int>(high.y()) - static_cast<int>(low.y()) + 1};
    Keep(patch);
    const double grey = light.grey_per_cd_m2 * light.room_cd_m2 * bar.reflectance;
    for (int row = 0; row < patch.height; ++row) {
      int16_t* pixel = PatchRow(patch, row).data();
      for (int column = 0; column < patch.width; ++column, pixel += 3) {
        const Eigen::Vector2d at(patch.x + column, patch.y + row);
        const auto cover = static_cast<double>(profile.At(static_cast<float>(bar.InsidePx(at))));
        if (cover <= 0) continue;
        const double its_grey = options.black_grey + grey * Passed(patch.x + column, patch.y + row);
        for (int channel = 0; channel < 3; ++channel) {
          const double behind = static_cast<double>(pixel[channel]) / kLinearPerGrey;
          pixel[channel] = ToLinear((1 - cover) * behind + cover * its_grey);
        }
      }
    }
    UpdateSigma(patch);
  }

  // A bar over one of the markers in the picture, in a share of the pictures.
  std::optional<OccludingBar> BarOf(const SceneFrame& frame,
                                    std::span<const MarkerTruth> markers) const {
    RandomStream random{options.seed, kFramePurpose, frame.seed, 2};
    if (markers.empty() || random.Uniform() >= options.occlusion) return std::nullopt;
    const MarkerTruth& covered =
        markers[static_cast<size_t>(random.Uniform() * static_cast<double>(markers.size()))];
    if (!covered.inside) return std::nullopt;
    return RandomBar(covered.centre_px, covered.radius_px, &random);
  }

  FrameTruth Draw(const SceneFrame& frame, std::span<const SphereMotion> spheres) {
    FrameTruth truth;
    if (spheres.empty()) return truth;
    truth.markers = TruthOf(intrinsics, size, spheres, radius_m, nullptr);
    const auto bar = BarOf(frame, truth.markers);
    if (bar) truth.markers = TruthOf(intrinsics, size, spheres, radius_m, &*bar);
    if (options.reflection > 0) DrawReflections(frame, spheres);
    truth.lit_share = DrawSpheres(frame, spheres);
    if (bar) DrawBar(*bar);
    return truth;
  }

  void Expose(uint64_t frame_seed, std::span<uint8_t> bgr) const {
    const size_t row_size = size_t{3} * size.width;
    const uint64_t seed = RandomStream{options.seed, kFramePurpose, frame_seed}.Bits();
    for (uint32_t y = 0; y < size.height; ++y) {
      const size_t at = y * row_size;
      noise.Expose({&scene[at], row_size}, {&sigma[at], row_size}, seed, static_cast<int>(y),
                   bgr.subspan(at, row_size));
    }
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
  const SensorNoise noise;
  SphereImager imager;
  // The room, and while a picture is made what is before it; sigma goes along.
  std::vector<int16_t> scene;
  std::vector<uint8_t> sigma;
  std::vector<ImagePatch> kept_patches;
  std::vector<int16_t> kept;
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
    return absl::InvalidArgumentError(absl::StrCat("a picture of ", image_size.width, "x",
                                                   image_size.height,
                                                   " px cannot be drawn, 2x2 to 134 Mpx can"));
  }
  RIGCAL_ASSIGN_OR_RETURN(RayGrid rays, RayGrid::Create(intrinsics, image_size));
  return SceneRenderer(
      std::make_unique<Impl>(intrinsics, image_size, target, options, std::move(rays)));
}

size_t SceneRenderer::buffer_size() const { return impl_->scene.size(); }
const ImageSize& SceneRenderer::image_size() const { return impl_->size; }
const FrameRenderOptions& SceneRenderer::options() const { return impl_->options; }

absl::StatusOr<FrameTruth> SceneRenderer::Render(const SceneFrame& frame, std::span<uint8_t> bgr) {
  std::vector<SphereMotion> spheres;
  if (frame.wand) {
    for (const double position_m : impl_->target.marker_positions_m) {
      spheres.push_back(frame.wand->Marker(position_m));
    }
  }
  return Render(frame, spheres, bgr);
}

absl::StatusOr<FrameTruth> SceneRenderer::Render(const SceneFrame& frame,
                                                 std::span<const SphereMotion> spheres,
                                                 std::span<uint8_t> bgr) {
  if (bgr.size() != buffer_size()) {
    return absl::InvalidArgumentError(absl::StrCat("the picture's buffer has ", bgr.size(),
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
  FrameTruth truth = impl_->Draw(frame, spheres);
  impl_->Expose(frame.seed, bgr);
  impl_->Restore();
  return truth;
}

}  // namespace rigcal

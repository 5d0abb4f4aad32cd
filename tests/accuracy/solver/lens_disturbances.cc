// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <utility>

#include "common/camera/camera_model.h"
#include "common/camera/fit_intrinsics.h"
#include "tests/accuracy/solver/disturbance.h"

namespace rigcal::accuracy {
namespace {

void ScaleFocalLength(double factor, server::CameraTrack* track) {
  track->camera.intrinsics->fx_px *= factor;
  track->camera.intrinsics->fy_px *= factor;
}

// Nobody has calibrated the lenses.
void GuessIntrinsics(double factor, server::CameraTrack* track) {
  Intrinsics& intrinsics = *track->camera.intrinsics;
  ScaleFocalLength(factor, track);
  intrinsics.cx_px = 0.5 * (track->camera.image_size_px.width - 1);
  intrinsics.cy_px = 0.5 * (track->camera.image_size_px.height - 1);
  std::ranges::fill(intrinsics.distortion, 0.0);
}

// The camera has another lens than the other one, and each was given the other's file.
void SwapFiles(DoctorPatient* patient) {
  server::CameraTrack& track = TrackOf(patient);
  const Intrinsics wide = *track.camera.intrinsics;
  Intrinsics narrow = wide;
  narrow.fx_px *= 1.2;
  narrow.fy_px *= 1.2;
  const ImageSize size = track.camera.image_size_px;
  ForEachCentre(&track, [&](double, MarkerObservation* marker) {
    const auto ray = Undistort(wide, marker->centre_px);
    Eigen::Vector2d centre_px;
    marker->visible = ray.ok() && Project(narrow, ray->homogeneous(), &centre_px) &&
                      centre_px.x() >= 0 && centre_px.y() >= 0 && centre_px.x() <= size.width - 1 &&
                      centre_px.y() <= size.height - 1;
    if (marker->visible) marker->centre_px = centre_px;
  });
  server::CameraTrack& other =
      *std::ranges::find(patient->input.tracks, patient->other_camera,
                         [](const server::CameraTrack& t) { return t.camera.camera; });
  track.camera.intrinsics = other.camera.intrinsics;
  other.camera.intrinsics = narrow;
}

constexpr double kNearer = 0.6;           // of the distance from the middle
constexpr double kHalfFieldRad = 1.1345;  // 65 degrees
constexpr double kDescribedShare = 0.9;   // of half the image's width, that a board reached
constexpr double kWideNoisePx = 0.3;
constexpr double kWideDropoutShare = 0.05;
constexpr double kMiddleHeightM = 1.5;

// A lens of 130 degrees across the image.
Intrinsics WideLens(const ImageSize& size) {
  const double focal_px = 0.5 * size.width / kHalfFieldRad;
  return {
      DistortionModel::kFisheye, focal_px, focal_px, 0.5 * size.width - 4, 0.5 * size.height + 3,
      {-0.02, 0.004, 0, 0}};
}

// What a calibration of `lens` by another model gives, by a board in most of the image.
Intrinsics DescribedBy(DistortionModel model, const Intrinsics& lens, const ImageSize& size) {
  std::vector<RayPixel> rays;
  constexpr int kSteps = 24;
  for (int x = 0; x <= kSteps; ++x) {
    for (int y = 0; y <= kSteps; ++y) {
      const Eigen::Vector2d pixel((size.width - 1.0) * x / kSteps,
                                  (size.height - 1.0) * y / kSteps);
      const Eigen::Vector2d from_centre = pixel - Eigen::Vector2d(lens.cx_px, lens.cy_px);
      if (from_centre.norm() > kDescribedShare * 0.5 * size.width) continue;
      const auto ray = Undistort(lens, pixel);
      if (ray.ok()) rays.push_back({ray->homogeneous(), pixel});
    }
  }
  const auto fit = FitIntrinsics(model, rays, lens);
  return fit.ok() ? fit->intrinsics : lens;
}

RigidTransform Nearer(RigidTransform cam_from_world) {
  const Eigen::Vector3d middle_m(0, 0, kMiddleHeightM);
  const Eigen::Vector3d centre_m =
      middle_m + kNearer * (cam_from_world.SourceFromTargetTranslation() - middle_m);
  cam_from_world.translation_m = -(cam_from_world.rotation * centre_m);
  return cam_from_world;
}

void Photograph(uint32_t seed, const SimulatedWorld& world, int camera, const Intrinsics& lens,
                const RigidTransform& cam_from_world, server::CameraTrack* track) {
  const ImageSize size = track->camera.image_size_px;
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, kWideNoisePx);
  std::bernoulli_distribution dropped(kWideDropoutShare);
  for (size_t i = 0; i < track->observations.size(); ++i) {
    Observation& row = track->observations[i];
    const WandPose wand = world.WandAt(world.FrameRigTime(camera, static_cast<int>(i)));
    row.markers.assign(static_cast<size_t>(world.target().marker_count()), {});
    for (size_t m = 0; m < row.markers.size(); ++m) {
      Eigen::Vector2d pixel;
      if (dropped(random) || !ImageOf(lens, cam_from_world * world.MarkerAt(wand, m), &pixel)) {
        continue;
      }
      pixel += Eigen::Vector2d(noise(random), noise(random));
      const bool inside = pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() <= size.width - 1 &&
                          pixel.y() <= size.height - 1;
      row.markers[m].visible = inside;
      if (inside) row.markers[m].centre_px = pixel;
    }
  }
}

// One camera, or all of them, stand nearer and have wide lenses, which `model` describes.
void PhotographWide(uint32_t seed, DistortionModel model, bool all, DoctorPatient* patient) {
  const SimulatedWorld& world = *patient->world;
  std::map<std::string, RigidTransform> cam_from_world;
  for (size_t c = 0; c < world.cameras().size(); ++c) {
    const SimulatedCamera& camera = world.cameras()[c];
    const std::string& name = camera.description.camera;
    cam_from_world[name] = camera.cam_from_rig;
    if (!all && name != patient->camera) continue;
    server::CameraTrack& track =
        *std::ranges::find(patient->input.tracks, name,
                           [](const server::CameraTrack& each) { return each.camera.camera; });
    const Intrinsics lens = WideLens(track.camera.image_size_px);
    cam_from_world[name] = Nearer(camera.cam_from_rig);
    Photograph(seed++, world, static_cast<int>(c), lens, cam_from_world[name], &track);
    track.camera.intrinsics = DescribedBy(model, lens, track.camera.image_size_px);
  }
  if (all) patient->distance_m *= kNearer;
  const RigidTransform world_from_first = cam_from_world.begin()->second.Inverse();
  for (const auto& [name, pose] : cam_from_world) {
    patient->cam_from_rig[name] = pose * world_from_first;
  }
}

}  // namespace

std::vector<Disturbance> LensDisturbances() {
  const std::vector<FindingKind> causes = {FindingKind::kWrongIntrinsics,
                                           FindingKind::kIntrinsicsFromPrior};
  const auto focal = [](double factor) {
    return [factor](uint32_t, server::CameraTrack* track) { ScaleFocalLength(factor, track); };
  };
  const auto guess = [](double factor) {
    return [factor](uint32_t, server::CameraTrack* track) { GuessIntrinsics(factor, track); };
  };
  std::vector<Disturbance> list = {
      OfTrack("focal length 3 % off", causes, false, focal(0.97)),
      OfTrack("focal length 10 % off", causes, false, focal(0.9)),
      OfTrack("focal 3 % off, kept", causes, false, focal(0.97)),
      OfTrack("lenses guessed, f 0.86", causes, true, guess(0.86)),
      OfTrack("lenses guessed, f 1.14", causes, true, guess(1.14)),
      OfTrack(
          "fy 9.5 % off", causes, false,
          [](uint32_t, server::CameraTrack* track) { track->camera.intrinsics->fy_px *= 1.095; }),
      {"files swapped", causes, "", false, false,
       [](uint32_t, DoctorPatient* patient) { SwapFiles(patient); }},
  };
  list[2].options.intrinsics = Estimate::kFixed;
  const auto wide = [](const std::string& name, std::vector<FindingKind> kinds,
                       DistortionModel model, bool all) {
    Disturbance disturbance{name,
                            std::move(kinds),
                            "",
                            !all,
                            false,
                            [model, all](uint32_t seed, DoctorPatient* patient) {
                              PhotographWide(seed, model, all, patient);
                            }};
    disturbance.of_simulation = true;
    return disturbance;
  };
  const std::vector<FindingKind> model = {FindingKind::kWrongLensModel};
  list.push_back(
      wide("fisheye as Brown-Conrady, one", model, DistortionModel::kBrownConrady, false));
  list.push_back(
      wide("fisheye as Brown-Conrady, all", model, DistortionModel::kBrownConrady, true));
  list.push_back(wide("clean with fisheyes", {}, DistortionModel::kFisheye, true));
  return list;
}

}  // namespace rigcal::accuracy

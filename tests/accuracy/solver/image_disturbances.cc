// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

#include "absl/strings/str_format.h"
#include "common/camera/camera_model.h"
#include "tests/accuracy/solver/disturbance.h"

namespace rigcal::accuracy {
namespace {

void AddNoise(uint32_t seed, double sigma_px, DoctorPatient* patient) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, sigma_px);
  ForEachCentre(&TrackOf(patient), [&](double, MarkerObservation* marker) {
    marker->centre_px += Eigen::Vector2d(noise(random), noise(random));
  });
}

// Whatever is detected is none of the markers.
void Scatter(uint32_t seed, server::CameraTrack* track) {
  std::mt19937 random(seed);
  const ImageSize size = track->camera.image_size_px;
  std::uniform_real_distribution<double> x(0, size.width - 1), y(0, size.height - 1);
  ForEachCentre(track, [&](double, MarkerObservation* marker) {
    marker->centre_px = {x(random), y(random)};
  });
}

void Mirror(bool upside_down, DoctorPatient* patient) {
  server::CameraTrack& track = TrackOf(patient);
  const ImageSize size = track.camera.image_size_px;
  ForEachCentre(&track, [&](double, MarkerObservation* marker) {
    double& value = upside_down ? marker->centre_px.y() : marker->centre_px.x();
    value = (upside_down ? size.height : size.width) - 1 - value;
  });
}

// The camera turns about its y axis by `degrees` from `from` of the way on.
void Turn(double degrees, double from, DoctorPatient* patient) {
  server::CameraTrack& track = TrackOf(patient);
  const Intrinsics& intrinsics = *track.camera.intrinsics;
  const Eigen::AngleAxisd turn(degrees * M_PI / 180, Eigen::Vector3d::UnitY());
  ForEachCentre(&track, [&](double share, MarkerObservation* marker) {
    const auto ray = Undistort(intrinsics, marker->centre_px);
    if (share >= from && ray.ok()) {
      Project(intrinsics, turn * ray->homogeneous(), &marker->centre_px);
    }
  });
}

// The images of another moment at every row.
void Reverse(DoctorPatient* patient) {
  std::vector<Observation>& rows = TrackOf(patient).observations;
  for (size_t i = 0; i < rows.size() / 2; ++i) {
    std::swap(rows[i].markers, rows[rows.size() - 1 - i].markers);
  }
}

}  // namespace

std::vector<Disturbance> ImageDisturbances() {
  std::vector<Disturbance> list;
  for (const double sigma_px : {2.0, 5.0, 10.0}) {
    list.push_back(
        {absl::StrFormat("noise of %.0f px", sigma_px),
         {FindingKind::kNoisyCamera},
         "noise",
         true,
         false,
         [sigma_px](uint32_t seed, DoctorPatient* patient) { AddNoise(seed, sigma_px, patient); }});
  }
  list.push_back({"mirrored",
                  {FindingKind::kMirroredImage},
                  "mirrored",
                  true,
                  false,
                  [](uint32_t, DoctorPatient* patient) { Mirror(false, patient); }});
  list.push_back({"upside down",
                  {FindingKind::kMirroredImage},
                  "mirrored",
                  true,
                  false,
                  [](uint32_t, DoctorPatient* patient) { Mirror(true, patient); }});
  list.push_back({"one camera garbage",
                  {FindingKind::kInconsistentCamera},
                  "leave it out",
                  true,
                  false,
                  [](uint32_t seed, DoctorPatient* patient) { Scatter(seed, &TrackOf(patient)); }});
  list.push_back({"one camera reversed",
                  {FindingKind::kInconsistentCamera},
                  "leave it out",
                  true,
                  false,
                  [](uint32_t, DoctorPatient* patient) { Reverse(patient); }});
  list.push_back({"all garbage", {}, "", false, false, [](uint32_t seed, DoctorPatient* patient) {
                    for (server::CameraTrack& track : patient->input.tracks) {
                      Scatter(seed++, &track);
                    }
                  }});
  for (const double degrees : {0.05, 0.1, 0.4, 1.0, 3.0}) {
    list.push_back({absl::StrFormat("turned %.2f degrees half-way", degrees),
                    {FindingKind::kCameraMoved},
                    "",
                    true,
                    false,
                    [degrees](uint32_t, DoctorPatient* patient) { Turn(degrees, 0.5, patient); }});
  }
  return list;
}

}  // namespace rigcal::accuracy

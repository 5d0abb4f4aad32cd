// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "common/camera/camera_model.h"
#include "tests/accuracy/solver/disturbance.h"
#include "tests/accuracy/solver/wand_from_one_view.h"

namespace rigcal::accuracy {
namespace {

constexpr double kRadians = M_PI / 180;
constexpr double kHandRadPerS[] = {2 * M_PI * 3.1, 2 * M_PI * 4.7};  // of a shaken tripod

RigidTransform Shifted(const Eigen::Vector3d& centre_m) {
  RigidTransform now;
  now.translation_m = -centre_m;
  return now;
}

RigidTransform Turned(double degrees, const Eigen::Vector3d& axis) {
  RigidTransform now;
  now.rotation = Eigen::AngleAxisd(degrees * kRadians, axis.normalized());
  return now;
}

bool IsAway(double share) { return share >= 0.4 && share < 0.6; }

Disturbance OfMotion(const std::string& name, const Motion& motion) {
  return {name,
          {FindingKind::kCameraMoved},
          "",
          true,
          false,
          [motion](uint32_t, DoctorPatient* patient) {
            MoveCamera(patient->input.target, motion, &TrackOf(patient));
          }};
}

// Both cameras are screwed to one bar, which turns about a point between them.
void TurnBar(double degrees, DoctorPatient* patient) {
  const RigidTransform first = patient->cam_from_rig.at(patient->camera);
  const RigidTransform second = patient->cam_from_rig.at(patient->other_camera);
  const Eigen::Vector3d middle_m =
      0.5 * (first.SourceFromTargetTranslation() + second.SourceFromTargetTranslation());
  RigidTransform bar;  // moved_from_rig
  bar.rotation = Eigen::AngleAxisd(degrees * kRadians, Eigen::Vector3d(0.3, 1, 0.2).normalized());
  bar.translation_m = middle_m - bar.rotation * middle_m;
  for (const std::string& camera : {patient->camera, patient->other_camera}) {
    const RigidTransform cam_from_rig = patient->cam_from_rig.at(camera);
    const RigidTransform moved = cam_from_rig * bar * cam_from_rig.Inverse();
    server::CameraTrack& track =
        *std::ranges::find(patient->input.tracks, camera,
                           [](const server::CameraTrack& each) { return each.camera.camera; });
    MoveCamera(
        patient->input.target,
        [moved](double share) { return share >= 0.5 ? moved : RigidTransform(); }, &track);
  }
}

void Zoom(const std::function<double(double share)>& factor, DoctorPatient* patient) {
  server::CameraTrack& track = TrackOf(patient);
  const Eigen::Vector2d principal_px(track.camera.intrinsics->cx_px,
                                     track.camera.intrinsics->cy_px);
  ForEachCentre(&track, [&](double share, MarkerObservation* marker) {
    marker->centre_px = principal_px + factor(share) * (marker->centre_px - principal_px);
  });
}

}  // namespace

std::vector<Disturbance> MoveDisturbances() {
  const Eigen::Vector3d right_m(0.02, 0, 0), ahead_m(0, 0, 0.02);
  const auto half_way = [](const RigidTransform& moved) {
    return [moved](double share) { return share >= 0.5 ? moved : RigidTransform(); };
  };
  const auto and_back = [](const RigidTransform& moved) {
    return [moved](double share) { return IsAway(share) ? moved : RigidTransform(); };
  };
  const Eigen::Vector3d up(0, 1, 0);
  std::vector<Disturbance> list = {
      OfMotion("shifted 20 mm half-way", half_way(Shifted(right_m))),
      OfMotion("shifted 20 mm ahead half-way", half_way(Shifted(ahead_m))),
      OfMotion("shifted 20 mm and back", and_back(Shifted(right_m))),
      OfMotion("turned 0.40 degrees and back", and_back(Turned(0.4, up))),
      OfMotion("turned twice",
               [up](double share) {
                 return Turned(share < 0.3 ? 0 : share < 0.7 ? 0.3 : 0.5, up);
               }),
      OfMotion("shaking 0.2 degrees",
               [](double share) {
                 // As long as the recordings here.
                 const double time_s = 60 * share;
                 return Turned(0.2 * std::sin(kHandRadPerS[0] * time_s), {0, 1, 0}) *
                        Turned(0.2 * std::sin(kHandRadPerS[1] * time_s), {1, 0, 0});
               }),
      OfMotion("sinking 0.3 degrees",
               [](double share) {
                 return Turned(0.3 * share, {1, 0, 0});
               }),
  };
  list.push_back({"two on a bar turned 0.40 degrees",
                  {FindingKind::kCameraMoved},
                  "",
                  false,
                  false,
                  [](uint32_t, DoctorPatient* patient) { TurnBar(0.4, patient); }});
  const auto zoom = [](const std::string& name, const std::function<double(double)>& factor) {
    return Disturbance{
        name,  {FindingKind::kLensChanged},
        "",    true,
        false, [factor](uint32_t, DoctorPatient* patient) { Zoom(factor, patient); }};
  };
  list.push_back(
      zoom("zoomed 1 % half-way", [](double share) { return share >= 0.5 ? 1.01 : 1.0; }));
  list.push_back(
      zoom("zoomed 1 % and back", [](double share) { return IsAway(share) ? 1.01 : 1.0; }));
  return list;
}

}  // namespace rigcal::accuracy

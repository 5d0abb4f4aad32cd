// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/solver/wand_from_one_view.h"

#include <cmath>

#include "common/camera/camera_model.h"

namespace rigcal::accuracy {
namespace {

void Picture(const Intrinsics& intrinsics, const Eigen::Vector3d& point_m, const ImageSize& size,
             MarkerObservation* marker) {
  Eigen::Vector2d pixel;
  marker->visible = Project(intrinsics, point_m, &pixel) && pixel.x() >= 0 && pixel.y() >= 0 &&
                    pixel.x() <= size.width - 1 && pixel.y() <= size.height - 1;
  if (marker->visible) marker->centre_px = pixel;
}

double ShareOf(const Observation& row, const std::pair<int64_t, double>& span) {
  return 1e-9 * static_cast<double>(row.time_ns - span.first) / span.second;
}

}  // namespace

std::optional<WandInCamera> WandFromOneView(const Target& target, const Intrinsics& intrinsics,
                                            const Observation& row) {
  if (row.markers.size() != 3 || target.marker_positions_m.size() != 3) return std::nullopt;
  std::array<Eigen::Vector3d, 3> rays;
  for (size_t m = 0; m < 3; ++m) {
    if (!row.markers[m].visible) return std::nullopt;
    const auto ray = Undistort(intrinsics, row.markers[m].centre_px);
    if (!ray.ok()) return std::nullopt;
    rays[m] = ray->homogeneous();
  }
  // The middle one lies on the line of the two others at a known share of the way: crossed with its
  // ray that gives the ratio of their depths.
  const double length_m = target.marker_positions_m[2];
  const double middle = target.marker_positions_m[1] / length_m;
  const double before = (1 - middle) * rays[0].cross(rays[1]).norm();
  const double behind = middle * rays[1].cross(rays[2]).norm();
  if (!(before > 0) || !(behind > 0)) return std::nullopt;
  const double ratio = before / behind;
  const double first_m = length_m / (ratio * rays[2] - rays[0]).norm();
  const Eigen::Vector3d begin_m = first_m * rays[0], end_m = first_m * ratio * rays[2];
  return WandInCamera{begin_m, (begin_m + middle * (end_m - begin_m)).eval(), end_m};
}

void MoveCamera(const Target& target, const Motion& now_from_begin, server::CameraTrack* track) {
  const Intrinsics intrinsics = *track->camera.intrinsics;
  const std::pair<int64_t, double> span = SpanOf(track->observations);
  std::optional<double> depth_m;
  for (Observation& row : track->observations) {
    const RigidTransform now = now_from_begin(ShareOf(row, span));
    const std::optional<WandInCamera> wand = WandFromOneView(target, intrinsics, row);
    if (wand) depth_m = (*wand)[1].z();
    for (size_t m = 0; m < row.markers.size(); ++m) {
      MarkerObservation& marker = row.markers[m];
      if (!marker.visible) continue;
      const auto ray = Undistort(intrinsics, marker.centre_px);
      if (!ray.ok() || !depth_m) {
        marker.visible = false;
        continue;
      }
      const double own_depth_m = wand ? (*wand)[m].z() : *depth_m;
      Picture(intrinsics, now * (own_depth_m * ray->homogeneous()), track->camera.image_size_px,
              &marker);
    }
  }
}

void ChangeWand(const std::function<void(double share, WandInCamera*)>& change,
                DoctorPatient* patient) {
  for (server::CameraTrack& track : patient->input.tracks) {
    const Intrinsics intrinsics = *track.camera.intrinsics;
    const RigidTransform& cam_from_rig = patient->cam_from_rig.at(track.camera.camera);
    const std::pair<int64_t, double> span = SpanOf(track.observations);
    for (Observation& row : track.observations) {
      const std::optional<WandInCamera> seen =
          WandFromOneView(patient->input.target, intrinsics, row);
      if (!seen) {
        for (MarkerObservation& marker : row.markers) marker.visible = false;
        continue;
      }
      WandInCamera straight, changed;
      for (size_t m = 0; m < 3; ++m) straight[m] = cam_from_rig.Inverse() * (*seen)[m];
      changed = straight;
      change(ShareOf(row, span), &changed);
      for (size_t m = 0; m < 3; ++m) {
        // What was measured, moved by what the change does to the image.
        Eigen::Vector2d before_px, after_px;
        MarkerObservation& marker = row.markers[m];
        marker.visible = Project(intrinsics, cam_from_rig * straight[m], &before_px) &&
                         Project(intrinsics, cam_from_rig * changed[m], &after_px);
        if (marker.visible) marker.centre_px += after_px - before_px;
      }
    }
  }
}

}  // namespace rigcal::accuracy

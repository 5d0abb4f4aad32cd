// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "common/camera/camera_model.h"
#include "common/camera/intrinsics_vector.h"
#include "server/solve/bundle/bundle_problem.h"

namespace rigcal::server {

// A bundle problem small enough to be followed by hand: cameras without rotation or distortion look
// along the rig's z, f = 1000 px, centre (640, 512); each sees every marker of every instant, a
// wand of 0, 0.13, 0.39 m, where it truly is. A marker behind its camera is at (0, 0).
struct ExactWand {
  Eigen::Vector3d origin_m;
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();
};

inline BundleProblem ExactProblem(const std::vector<Eigen::Vector3d>& camera_centres_m,
                                  const std::vector<ExactWand>& wands) {
  BundleProblem problem;
  problem.clocks.resize(1);
  problem.target.marker_positions_m = {0, 0.13, 0.39};
  problem.target.given_positions_m = problem.target.marker_positions_m;
  for (size_t c = 0; c < camera_centres_m.size(); ++c) {
    BundleCamera camera;
    camera.name = "camera_" + std::to_string(c);
    camera.cam_from_rig.translation_m = -camera_centres_m[c];
    camera.pose_fixed = c == 0;
    camera.intrinsics = IntrinsicsVector::Zero(IntrinsicsSize(camera.model));
    camera.intrinsics.head<4>() << 1000, 1000, 640, 512;
    problem.cameras.push_back(std::move(camera));
  }
  for (const ExactWand& wand : wands) {
    BundleInstant instant;
    instant.origin_m = wand.origin_m;
    instant.direction = wand.direction.normalized();
    instant.first_observation = static_cast<int>(problem.observations.size());
    instant.observation_count = static_cast<int>(camera_centres_m.size());
    for (size_t c = 0; c < camera_centres_m.size(); ++c) {
      const BundleCamera& camera = problem.cameras[c];
      problem.observations.push_back(
          {static_cast<int>(c), 0, 0, static_cast<int>(problem.markers.size()), 3});
      for (int m = 0; m < 3; ++m) {
        BundleMarker marker;
        marker.marker = m;
        const Eigen::Vector3d x_in_rig =
            instant.origin_m +
            problem.target.marker_positions_m[static_cast<size_t>(m)] * instant.direction;
        Eigen::Vector2d pixel;
        if (Project(camera.model, camera.intrinsics.data(), camera.cam_from_rig * x_in_rig, &pixel,
                    nullptr, nullptr)) {
          marker.centre_px = pixel;
        }
        problem.markers.push_back(marker);
      }
    }
    problem.instants.push_back(instant);
  }
  return problem;
}

}  // namespace rigcal::server

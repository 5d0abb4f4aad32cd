// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "server/associate/instants.h"
#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/rig/image_motion.h"
#include "server/solve/rig/problem_builder.h"

namespace rigcal::server {

struct TrajectoryFit;

// What came out.
struct RigSolution {
  BuiltProblem built;                   // solved; markers not used are the outliers
  std::vector<ClockCorrection> clocks;  // what `built` was interpolated with
  std::vector<double> line_delay_s;     // by camera, likewise
  std::vector<ImageMotion> motions;     // by track, outlying centres excluded, labels flipped
  InstantList instants;
  std::vector<std::pair<int, int>>
      spanning_tree;  // of cameras; empty where an initialization was given
  int iterations = 0;
  bool converged = false;
  // Where the target was followed through time (trajectory_fit.h): cameras, clocks and target are
  // those of its optimum, and `built` is only placed by them. Null: `built` was solved.
  std::shared_ptr<const TrajectoryFit> trajectory;

  // State that is needed to rebuild `built` after it was released.
  struct PutAway {
    std::vector<bool> used;                   // by marker
    std::vector<Eigen::Vector2d> centres_px;  // by marker; empty where they are as observed
  };
  std::optional<PutAway> put_away;
};

// The labels of this observation were given counted from the target's other end.
bool IsFlipped(const RigSolution& solution, const BundleObservation& observation);

// The target's pose, as of BundleInstant.
struct TargetPose {
  Eigen::Vector3d origin_m, direction;
  BundleInstant::Quaternion rotation;
};
// At an instant, known by its first member.
using InstantPoses = std::map<std::pair<int, int>, TargetPose>;

// Initial values of a solve.
struct RigInitialization {
  std::vector<BundleCamera> cameras;  // poses and intrinsics
  std::vector<double> marker_positions_m;
  std::vector<Eigen::Vector3d> points_m;  // of a rigid target; empty: as given
  std::optional<BundleDistance> distance;
  std::vector<ClockCorrection> clocks;
  std::vector<double> line_delay_s;  // by camera; empty: none
  InstantPoses instants;             // those not named are placed anew
};

RigInitialization InitializationFrom(const RigSolution& solution);

}  // namespace rigcal::server

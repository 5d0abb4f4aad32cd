// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <set>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/initialize/overlap_graph.h"

namespace rigcal::server {

// Where a camera sees a target of one marker.
struct RayOfCamera {
  int camera;
  Eigen::Vector2d ray;  // normalised coordinates without distortion
};
using RaysOfInstant = std::vector<RayOfCamera>;  // of one instant, one of each camera

// Of the instants in which two cameras or more see the marker. `rays` by marker index.
std::vector<RaysOfInstant> SharedRays(const BundleProblem& problem,
                                      const std::vector<Eigen::Vector2d>& rays);

// Chooses the camera to join next to those of one scale, by counts alone: the scale is carried
// by instants that three cameras share. What is referred to must outlive it.
class PointJoins {
 public:
  using CameraPair = std::pair<int, int>;

  // A way to join camera `next`: beside camera `via`, in instants that others that are joined
  // share.
  struct Join {
    int weight = 0;
    int via = -1, next = -1;
  };

  PointJoins(const OverlapGraph& graph, const std::vector<RaysOfInstant>& instants);

  // Pairs to begin with: those from which most is reached, then those that share most.
  std::vector<CameraPair> Seeds() const;
  // The join with most instants that has not failed; `next` -1: none. `joined` by camera.
  Join Best(const std::vector<bool>& joined, const std::set<CameraPair>& failed) const;
  // FAILED_PRECONDITION: names the groups and the three cameras which would best join them.
  absl::Status NotJoined(std::vector<bool> reached) const;

 private:
  // Instants that three cameras share.
  int SharedBy(int a, int b, int c) const;
  size_t TripleIndex(int a, int b, int c) const;
  // Instants that `via`, `next` and another camera that is joined share, at least.
  int Weight(const std::vector<bool>& joined, int via, int next) const;
  // The number of cameras that can be reached, by counts alone.
  int Reach(int a, int b) const;

  const OverlapGraph& graph_;
  const int count_;  // cameras
  std::vector<int> triple_counts_;
};

}  // namespace rigcal::server

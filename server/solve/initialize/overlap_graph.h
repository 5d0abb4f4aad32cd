// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/solve/geometry/relative_pose.h"

namespace rigcal::server {

// Counts of wand views that cameras share.
struct OverlapGraph {
  std::vector<std::string> cameras;
  std::vector<int> view_counts;                 // wand views of each camera
  std::vector<std::string> notes;               // by camera, for error messages; may be empty
  std::vector<std::vector<int>> shared_counts;  // instants that two cameras share, symmetric
  int min_shared = 8;                           // fewer do not make an edge
  // Edges (a < b) that have misled before: taken only where nothing else joins their cameras.
  std::vector<std::pair<int, int>> avoided;
  // Where two cameras saw the target together, for error messages; may be none.
  std::function<std::string(int a, int b)> describe;
};

struct OverlapEdge {
  int a = 0, b = 0;   // a < b
  double weight = 0;  // shared instants that survive the relative pose
  RelativePose pose;  // b_from_a
};

// Cameras that no chain of pairs connects: what FindSpanningTree says of them beside its message.
struct UnconnectedGroups {
  // Two cameras of two groups that share most wand views, else that saw the wand most often.
  struct NearestPair {
    int a = 0, b = 0;
    int shared_count = 0;
  };
  std::vector<std::vector<int>> groups;  // of cameras, ascending
  std::vector<NearestPair> nearest;      // of every two groups
};
// None where an error says no such thing.
std::optional<UnconnectedGroups> UnconnectedGroupsOf(const absl::Status& status);
// The error without them.
absl::Status WithoutGroups(absl::Status status);

// The pose b_from_a of a pair of cameras, a < b, or none where it cannot be had.
using PairEstimate = std::function<absl::StatusOr<std::optional<RelativePose>>(int a, int b)>;

// The spanning tree with the greatest weights. Relative poses are only estimated where they can
// matter: an edge is looked at when nothing heavier is left, its shared instants being the most it
// can weigh; edges that keep three quarters of their views count as keeping all.
//
// FAILED_PRECONDITION where the cameras are not connected: names the groups, the pair that would
// best join them, and what to do (UnconnectedGroupsOf has the groups). Errors of `estimate` are
// passed on (cancellation).
absl::StatusOr<std::vector<OverlapEdge>> FindSpanningTree(const OverlapGraph& graph,
                                                          const PairEstimate& estimate);

}  // namespace rigcal::server

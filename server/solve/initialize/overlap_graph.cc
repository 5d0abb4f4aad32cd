// SPDX-License-Identifier: Apache-2.0
#include "server/solve/initialize/overlap_graph.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <queue>
#include <sstream>
#include <string>
#include <tuple>

#include "absl/strings/cord.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/status/status_macros.h"

namespace rigcal::server {
namespace {

// An edge that keeps this share (inverse) of its views is as good as any: looking at all edges of a
// large rig to find slightly heavier ones would cost more than it gives.
constexpr double kGoodEnough = 1.3;
// Weight factor of an edge to be avoided: less than any other edge.
constexpr double kAvoidedShare = 1e-6;
// Shared views beyond which their number is no reason for a pose that cannot be had.
constexpr int kManyShared = 40;
// Of the payload that has the groups: "group" and its cameras, or "pair", two cameras, and what
// they share, line by line.
constexpr char kGroupsUrl[] = "rigcal/unconnected_groups";

// Disjoint sets of cameras.
class Groups {
 public:
  explicit Groups(size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0); }
  int Find(int camera) const {
    while (parent_[static_cast<size_t>(camera)] != camera) {
      camera = parent_[static_cast<size_t>(camera)];
    }
    return camera;
  }
  void Join(int a, int b) {
    const int low = std::min(Find(a), Find(b)), high = std::max(Find(a), Find(b));
    parent_[static_cast<size_t>(high)] = low;
  }

 private:
  std::vector<int> parent_;
};

// Weight, or the most it can be; whether it is known; minus a, minus b: of equal ones the lowest
// names come first.
using Candidate = std::tuple<double, bool, int, int>;

std::string NameGroup(const OverlapGraph& graph, const std::vector<int>& group) {
  std::vector<std::string> names;
  for (const int camera : group) {
    const auto c = static_cast<size_t>(camera);
    names.push_back(c < graph.notes.size() && !graph.notes[c].empty()
                        ? absl::StrCat(graph.cameras[c], " (", graph.notes[c], ")")
                        : graph.cameras[c]);
  }
  return absl::StrCat("{", absl::StrJoin(names, ", "), "}");
}

using BestPair = std::tuple<int, int, int, int>;  // shared, seen by both, -a, -b

BestPair PairOf(const OverlapGraph& graph, int a, int b) {
  const auto left = static_cast<size_t>(a), right = static_cast<size_t>(b);
  return {graph.shared_counts[left][right],
          std::min(graph.view_counts[left], graph.view_counts[right]), -a, -b};
}

absl::Cord TextOf(const OverlapGraph& graph, const Groups& groups,
                  const std::map<int, std::vector<int>>& members) {
  std::string text;
  std::map<std::pair<int, int>, BestPair> nearest;  // by the groups' first cameras
  const int count = static_cast<int>(graph.cameras.size());
  for (int a = 0; a < count; ++a) {
    for (int b = a + 1; b < count; ++b) {
      const std::pair<int, int> key = std::minmax(groups.Find(a), groups.Find(b));
      if (key.first == key.second) continue;
      const BestPair pair = PairOf(graph, a, b);
      const auto [known, is_new] = nearest.try_emplace(key, pair);
      if (!is_new) known->second = std::max(known->second, pair);
    }
  }
  for (const auto& [root, group] : members) {
    absl::StrAppend(&text, "group ", absl::StrJoin(group, " "), "\n");
  }
  for (const auto& [key, pair] : nearest) {
    absl::StrAppend(&text, "pair ", -std::get<2>(pair), " ", -std::get<3>(pair), " ",
                    std::get<0>(pair), "\n");
  }
  return absl::Cord(text);
}

absl::Status NotConnected(const OverlapGraph& graph, const Groups& groups,
                          const std::map<std::pair<int, int>, int>& survivors) {
  std::map<int, std::vector<int>> members;
  const int count = static_cast<int>(graph.cameras.size());
  for (int c = 0; c < count; ++c) members[groups.Find(c)].push_back(c);
  std::vector<std::string> names;
  for (const auto& [root, group] : members) names.push_back(NameGroup(graph, group));
  BestPair best(-1, -1, 0, 0);
  for (int a = 0; a < count; ++a) {
    for (int b = a + 1; b < count; ++b) {
      if (groups.Find(a) == groups.Find(b)) continue;
      best = std::max(best, PairOf(graph, a, b));
    }
  }
  const int a = -std::get<2>(best), b = -std::get<3>(best), shared = std::get<0>(best);
  const auto tried = survivors.find({a, b});
  std::string why = absl::StrCat("they share ", shared, " wand views");
  if (tried != survivors.end()) {
    absl::StrAppend(&why, ", of which ", tried->second, " agree on a relative pose");
  }
  const std::string where = graph.describe ? graph.describe(a, b) : "";
  // Many views that contradict each other are not cured by more of them.
  const bool contradict =
      tried != survivors.end() && shared >= kManyShared && tried->second * 2 < shared;
  absl::Status status = absl::FailedPreconditionError(absl::StrCat(
      "the cameras are not connected: ", members.size(), " groups share too few wand views",
      contradict ? " that agree: " : ": ", absl::StrJoin(names, " and "), "; ",
      graph.cameras[static_cast<size_t>(a)], " and ", graph.cameras[static_cast<size_t>(b)],
      " would best join them (", why, "; at least ", graph.min_shared, " are needed",
      where.empty() ? "" : "; ", where, "): ",
      contradict
          ? "so many that disagree come from clocks that are apart, from intrinsics of another "
            "lens, from wrong marker positions, or from a wand that was hardly moved: check the "
            "clocks and YAML files of these two and the target, then "
          : "",
      "wave the wand where both of them see it at the same time, turning and moving it in depth, "
      "and calibrate again"));
  status.SetPayload(kGroupsUrl, TextOf(graph, groups, members));
  return status;
}

}  // namespace

std::optional<UnconnectedGroups> UnconnectedGroupsOf(const absl::Status& status) {
  const auto payload = status.GetPayload(kGroupsUrl);
  if (!payload) return std::nullopt;
  UnconnectedGroups unconnected;
  std::istringstream lines{std::string(*payload)};
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string kind;
    words >> kind;
    std::vector<int> numbers;
    for (int number = 0; words >> number;) numbers.push_back(number);
    if (kind == "group") unconnected.groups.push_back(std::move(numbers));
    if (kind == "pair" && numbers.size() == 3) {
      unconnected.nearest.push_back({numbers[0], numbers[1], numbers[2]});
    }
  }
  return unconnected;
}

absl::Status WithoutGroups(absl::Status status) {
  status.ErasePayload(kGroupsUrl);
  return status;
}

absl::StatusOr<std::vector<OverlapEdge>> FindSpanningTree(const OverlapGraph& graph,
                                                          const PairEstimate& estimate) {
  const int count = static_cast<int>(graph.cameras.size());
  Groups groups(graph.cameras.size());
  std::priority_queue<Candidate> queue;
  for (int a = 0; a < count; ++a) {
    for (int b = a + 1; b < count; ++b) {
      const int shared = graph.shared_counts[static_cast<size_t>(a)][static_cast<size_t>(b)];
      if (shared < graph.min_shared) continue;
      const bool avoided = std::ranges::count(graph.avoided, std::make_pair(a, b)) > 0;
      queue.push({avoided ? kAvoidedShare * shared : shared, false, -a, -b});
    }
  }
  std::map<std::pair<int, int>, RelativePose> poses;
  std::map<std::pair<int, int>, int> survivors;
  std::vector<OverlapEdge> tree;
  while (!queue.empty() && static_cast<int>(tree.size()) + 1 < count) {
    const auto [bound, estimated, minus_a, minus_b] = queue.top();
    queue.pop();
    const int a = -minus_a, b = -minus_b;
    if (groups.Find(a) == groups.Find(b)) continue;
    if (estimated) {
      groups.Join(a, b);
      tree.push_back({a, b, bound, poses[{a, b}]});
      continue;
    }
    RIGCAL_ASSIGN_OR_RETURN(const std::optional<RelativePose> pose, estimate(a, b));
    const double share = pose ? static_cast<double>(pose->inlier_count) / pose->instant_count : 0;
    const double agreeing =
        share * graph.shared_counts[static_cast<size_t>(a)][static_cast<size_t>(b)];
    survivors[{a, b}] = static_cast<int>(agreeing);
    if (agreeing < graph.min_shared) continue;
    poses[{a, b}] = *pose;
    queue.push({std::min(bound, kGoodEnough * share * bound), true, -a, -b});
  }
  if (static_cast<int>(tree.size()) + 1 < count) return NotConnected(graph, groups, survivors);
  return tree;
}

}  // namespace rigcal::server

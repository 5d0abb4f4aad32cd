// SPDX-License-Identifier: Apache-2.0
#include "server/solve/initialize/point_joins.h"

#include <algorithm>
#include <string>
#include <tuple>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace rigcal::server {
namespace {

constexpr size_t kMaxSeeds = 50;  // pairs that are looked at for one from which all are reached

}  // namespace

std::vector<RaysOfInstant> SharedRays(const BundleProblem& problem,
                                      const std::vector<Eigen::Vector2d>& rays) {
  std::vector<RaysOfInstant> all;
  for (const BundleInstant& instant : problem.instants) {
    RaysOfInstant views;
    for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
      if (observation.marker_count == 0) continue;
      const auto m = static_cast<size_t>(observation.first_marker);
      if (problem.markers[m].used && rays[m].allFinite()) {
        views.push_back({observation.camera, rays[m]});
      }
    }
    if (views.size() >= 2) all.push_back(std::move(views));
  }
  return all;
}

PointJoins::PointJoins(const OverlapGraph& graph, const std::vector<RaysOfInstant>& instants)
    : graph_(graph),
      count_(static_cast<int>(graph.cameras.size())),
      triple_counts_(graph.cameras.size() * graph.cameras.size() * graph.cameras.size(), 0) {
  for (const RaysOfInstant& sights : instants) {
    for (const RayOfCamera& a : sights) {
      for (const RayOfCamera& b : sights) {
        if (b.camera <= a.camera) continue;
        for (const RayOfCamera& c : sights) {
          if (c.camera > b.camera) ++triple_counts_[TripleIndex(a.camera, b.camera, c.camera)];
        }
      }
    }
  }
}

int PointJoins::SharedBy(int a, int b, int c) const {
  if (a > b) std::swap(a, b);
  if (b > c) std::swap(b, c);
  if (a > b) std::swap(a, b);
  return triple_counts_[TripleIndex(a, b, c)];
}

size_t PointJoins::TripleIndex(int a, int b, int c) const {
  const auto cameras = static_cast<size_t>(count_);
  return (static_cast<size_t>(a) * cameras + static_cast<size_t>(b)) * cameras +
         static_cast<size_t>(c);
}

int PointJoins::Weight(const std::vector<bool>& joined, int via, int next) const {
  int most = 0;
  for (int a = 0; a < count_; ++a) {
    if (joined[static_cast<size_t>(a)] && a != via) most = std::max(most, SharedBy(a, via, next));
  }
  return most;
}

PointJoins::Join PointJoins::Best(const std::vector<bool>& joined,
                                  const std::set<CameraPair>& failed) const {
  Join best;
  for (int via = 0; via < count_; ++via) {
    if (!joined[static_cast<size_t>(via)]) continue;
    for (int next = 0; next < count_; ++next) {
      if (joined[static_cast<size_t>(next)] || failed.contains({via, next})) continue;
      const int weight = Weight(joined, via, next);
      if (weight >= graph_.min_shared && weight > best.weight) best = {weight, via, next};
    }
  }
  return best;
}

int PointJoins::Reach(int a, int b) const {
  std::vector<bool> joined(static_cast<size_t>(count_), false);
  joined[static_cast<size_t>(a)] = joined[static_cast<size_t>(b)] = true;
  int size = 2;
  for (bool grown = true; grown;) {
    grown = false;
    for (int next = 0; next < count_; ++next) {
      if (joined[static_cast<size_t>(next)]) continue;
      for (int via = 0; via < count_ && !joined[static_cast<size_t>(next)]; ++via) {
        if (!joined[static_cast<size_t>(via)] || Weight(joined, via, next) < graph_.min_shared) {
          continue;
        }
        joined[static_cast<size_t>(next)] = grown = true;
        ++size;
      }
    }
  }
  return size;
}

std::vector<PointJoins::CameraPair> PointJoins::Seeds() const {
  std::vector<std::tuple<int, int, int>> pairs;  // minus shared, a, b
  for (int a = 0; a < count_; ++a) {
    for (int b = a + 1; b < count_; ++b) {
      const int shared = graph_.shared_counts[static_cast<size_t>(a)][static_cast<size_t>(b)];
      if (shared >= graph_.min_shared) pairs.emplace_back(-shared, a, b);
    }
  }
  std::ranges::sort(pairs);
  if (pairs.size() > kMaxSeeds) pairs.resize(kMaxSeeds);
  std::vector<std::pair<int, CameraPair>> reaches;
  for (const auto& [shared, a, b] : pairs) {
    reaches.push_back({-Reach(a, b), {a, b}});
    if (-reaches.back().first == count_ && reaches.size() >= 4) break;
  }
  std::ranges::stable_sort(reaches, {}, &std::pair<int, CameraPair>::first);
  std::vector<CameraPair> seeds;
  for (const auto& [reach, pair] : reaches) seeds.push_back(pair);
  if (seeds.size() > 4) seeds.resize(4);
  return seeds;
}

absl::Status PointJoins::NotJoined(std::vector<bool> reached) const {
  const auto name = [this](int camera) { return graph_.cameras[static_cast<size_t>(camera)]; };
  reached.resize(static_cast<size_t>(count_), false);
  std::vector<std::string> inside, outside;
  std::tuple<int, int, int> best(-1, 0, 0);  // shared, minus via, minus next
  for (int via = 0; via < count_; ++via) {
    (reached[static_cast<size_t>(via)] ? inside : outside).push_back(name(via));
    for (int next = 0; next < count_; ++next) {
      if (!reached[static_cast<size_t>(via)] || reached[static_cast<size_t>(next)]) continue;
      best = std::max(
          best,
          {graph_.shared_counts[static_cast<size_t>(via)][static_cast<size_t>(next)], -via, -next});
    }
  }
  if (inside.size() < 2) {
    return absl::FailedPreconditionError(
        "no two cameras agree on a relative pose from which the others could be placed: move the "
        "marker through all of what they see, near and far");
  }
  const int via = -std::get<1>(best), next = -std::get<2>(best);
  int third = -1, shared = -1;
  for (int a = 0; a < count_; ++a) {
    const int both = graph_.shared_counts[static_cast<size_t>(a)][static_cast<size_t>(via)];
    if (a == via || !reached[static_cast<size_t>(a)] || both <= shared) continue;
    third = a;
    shared = both;
  }
  return absl::FailedPreconditionError(absl::StrCat(
      "the scale cannot be carried from the cameras {", absl::StrJoin(inside, ", "), "} to {",
      absl::StrJoin(outside, ", "),
      "}: with one marker it takes instants that three cameras "
      "share, and ",
      name(via), " and ", name(next), " share ", std::get<0>(best), " instants but only ",
      Weight(reached, via, next), " with one of the others as well that can be used (at least ",
      graph_.min_shared, " are needed); wave the marker where ", name(third), ", ", name(via),
      " and ", name(next), " see it at the same time, or use a wand with two or more markers"));
}

}  // namespace rigcal::server

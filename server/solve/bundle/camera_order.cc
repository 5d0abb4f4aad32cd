// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/camera_order.h"

#include <algorithm>
#include <cstddef>

namespace rigcal::server {
namespace {

// With fewer, an order gains nothing.
constexpr size_t kManyCameras = 24;
// Of all pairs of cameras: with more that share instants, an order gains nothing.
constexpr double kFewPairs = 0.5;

using Graph = std::vector<std::vector<size_t>>;

// Which of the cameras share an instant. `place`: by camera of the problem.
Graph ShareInstants(const BundleProblem& problem, const std::vector<int>& place, size_t count) {
  std::vector<bool> shared(count * count, false);
  std::vector<size_t> seeing;
  for (const BundleInstant& instant : problem.instants) {
    seeing.clear();
    ForEachUsedMarker(
        problem, instant, [&](const BundleObservation& observation, const BundleMarker&) {
          const auto own = static_cast<size_t>(place[static_cast<size_t>(observation.camera)]);
          if (seeing.empty() || seeing.back() != own) seeing.push_back(own);
        });
    for (const size_t a : seeing) {
      for (const size_t b : seeing) shared[a * count + b] = true;
    }
  }
  Graph graph(count);
  for (size_t a = 0; a < count; ++a) {
    for (size_t b = 0; b < count; ++b) {
      if (a != b && shared[a * count + b]) graph[a].push_back(b);
    }
  }
  return graph;
}

// Nodes that can be reached from `start`, nearest first, of equally near ones that with the fewest
// neighbours first. Only those that are not `taken`.
std::vector<size_t> ByDistance(const Graph& graph, size_t start, std::vector<bool> taken) {
  std::vector<size_t> reached = {start};
  taken[start] = true;
  for (size_t i = 0; i < reached.size(); ++i) {
    const size_t begin = reached.size();
    for (const size_t next : graph[reached[i]]) {
      if (taken[next]) continue;
      taken[next] = true;
      reached.push_back(next);
    }
    std::stable_sort(reached.begin() + static_cast<std::ptrdiff_t>(begin), reached.end(),
                     [&graph](size_t a, size_t b) { return graph[a].size() < graph[b].size(); });
  }
  return reached;
}

// Each part of the graph starts at a node far out.
std::vector<size_t> ReverseCuthillMcKee(const Graph& graph) {
  constexpr int kSteps = 2;
  std::vector<bool> taken(graph.size(), false);
  std::vector<size_t> order;
  for (size_t node = 0; node < graph.size(); ++node) {
    if (taken[node]) continue;
    std::vector<size_t> part = ByDistance(graph, node, taken);
    for (int i = 0; i < kSteps; ++i) part = ByDistance(graph, part.back(), taken);
    for (const size_t own : part) taken[own] = true;
    order.insert(order.end(), part.begin(), part.end());
  }
  std::reverse(order.begin(), order.end());
  return order;
}

}  // namespace

CameraOrder OrderCameras(const BundleProblem& problem) {
  std::vector<int> place(problem.cameras.size(), -1);
  for (const BundleInstant& instant : problem.instants) {
    ForEachUsedMarker(problem, instant,
                      [&place](const BundleObservation& observation, const BundleMarker&) {
                        place[static_cast<size_t>(observation.camera)] = 0;
                      });
  }
  CameraOrder order;
  for (size_t c = 0; c < place.size(); ++c) {
    if (place[c] < 0) continue;
    place[c] = static_cast<int>(order.cameras.size());
    order.cameras.push_back(static_cast<int>(c));
  }
  const size_t count = order.cameras.size();
  if (count < kManyCameras) return order;
  const Graph graph = ShareInstants(problem, place, count);
  size_t pairs = 0;
  for (const std::vector<size_t>& neighbours : graph) pairs += neighbours.size();
  if (static_cast<double>(pairs) > kFewPairs * static_cast<double>(count * (count - 1))) {
    return order;
  }
  const std::vector<int> numbered = order.cameras;
  order.cameras.clear();
  for (const size_t node : ReverseCuthillMcKee(graph)) order.cameras.push_back(numbered[node]);
  order.is_sparse = true;
  return order;
}

}  // namespace rigcal::server

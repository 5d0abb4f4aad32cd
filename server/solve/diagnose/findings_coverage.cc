// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "server/solve/diagnose/finding_causes.h"
#include "server/solve/initialize/shared_views.h"

namespace rigcal::server {
namespace {

constexpr int kColumns = 6, kRows = 5;
// A side counts as not covered when so many of its cells hold no marker; the camera is named when
// so many of all cells do.
constexpr double kEmptyShareOfSide = 0.8;
constexpr double kEmptyShareOfImage = 0.4;
constexpr int kFewInstants = 50;

using Cells = std::array<std::array<int, kColumns>, kRows>;

std::vector<std::string> EmptySides(const Cells& cells) {
  const auto is_empty = [&cells](bool column, size_t at) {
    int empty = 0;
    const int size = column ? kRows : kColumns;
    for (size_t i = 0; i < static_cast<size_t>(size); ++i) {
      empty += (column ? cells[i][at] : cells[at][i]) == 0 ? 1 : 0;
    }
    return empty >= kEmptyShareOfSide * size;
  };
  std::vector<std::string> sides;
  if (is_empty(true, 0)) sides.emplace_back("left");
  if (is_empty(true, kColumns - 1)) sides.emplace_back("right");
  if (is_empty(false, 0)) sides.emplace_back("top");
  if (is_empty(false, kRows - 1)) sides.emplace_back("bottom");
  return sides;
}

}  // namespace

std::vector<Cause> FindUnseenEdges(const CauseInput& input) {
  // Of all markers, not the trial's share of them.
  const BundleProblem& problem = input.evaluated.solution.built.problem;
  std::vector<Cells> cells(problem.cameras.size(), Cells{});
  ForEachMarker(problem, [&](size_t, const BundleObservation& observation, size_t m) {
    if (!problem.markers[m].used) return;
    const auto c = static_cast<size_t>(observation.camera);
    const ImageSize& size = input.rig.index.cameras[c].image_size_px;
    const Eigen::Vector2d& centre = problem.markers[m].centre_px;
    const int column = static_cast<int>(kColumns * (centre.x() + 0.5) / size.width);
    const int row = static_cast<int>(kRows * (centre.y() + 0.5) / size.height);
    ++cells[c][static_cast<size_t>(std::clamp(row, 0, kRows - 1))]
           [static_cast<size_t>(std::clamp(column, 0, kColumns - 1))];
  });
  std::vector<Cause> causes;
  for (size_t c = 0; c < cells.size(); ++c) {
    // Given intrinsics hold where nothing was seen; refined ones are a guess there.
    if (problem.cameras[c].intrinsics_fixed) continue;
    const std::vector<std::string> sides = EmptySides(cells[c]);
    int empty = 0;
    for (const auto& row : cells[c])
      empty += static_cast<int>(std::count(row.begin(), row.end(), 0));
    const double share = static_cast<double>(empty) / (kColumns * kRows);
    if (sides.empty() || share < kEmptyShareOfImage) continue;
    causes.push_back(
        {{FindingKind::kEdgeCoverage, problem.cameras[c].name, 100 * share, "%",
          absl::StrFormat("%.0f %% of its image saw no marker, nearly all of the %s side among it; "
                          "its refined intrinsics are a guess there. Wave the wand along that edge",
                          100 * share, absl::StrJoin(sides, " and "))},
         0});
  }
  return causes;
}

std::vector<Cause> FindWeakLinks(const CauseInput& input) {
  const BundleProblem& problem = input.evaluated.solution.built.problem;
  const std::vector<std::vector<int>> shared = CountShared(
      problem, [&problem](const BundleInstant& instant, const BundleObservation& observation) {
        return instant.used &&
               std::ranges::any_of(problem.MarkersOf(observation), &BundleMarker::used);
      });
  const size_t count = problem.cameras.size();
  // Prim: the strongest way to join one camera after the other; a weak edge of this tree has no
  // stronger way round it.
  std::vector<bool> joined(count, false);
  joined[0] = true;
  std::vector<Cause> causes;
  for (size_t step = 1; step < count; ++step) {
    size_t best_a = 0, best_b = 0;
    int best = -1;
    for (size_t a = 0; a < count; ++a) {
      if (!joined[a]) continue;
      for (size_t b = 0; b < count; ++b) {
        if (!joined[b] && shared[a][b] > best) {
          best = shared[a][b];
          best_a = a;
          best_b = b;
        }
      }
    }
    joined[best_b] = true;
    if (best >= kFewInstants) continue;
    causes.push_back(
        {{FindingKind::kWeakLink, problem.cameras[best_b].name, static_cast<double>(best),
          "instants",
          absl::StrFormat("it hangs on %d instants that it shares with %s, and on fewer with any "
                          "other camera joined before it. Wave the wand where both see it",
                          best, problem.cameras[best_a].name)},
         0});
  }
  return causes;
}

}  // namespace rigcal::server

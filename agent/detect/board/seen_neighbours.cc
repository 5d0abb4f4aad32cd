// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/board/seen_neighbours.h"

#include <algorithm>
#include <tuple>

namespace rigcal::agent {
namespace {

constexpr size_t kFewPoints = 6;

}  // namespace

std::vector<PatternPixel> SeenNeighbours(const PrintedPattern& pattern, const SeenBoard& seen,
                                         const Eigen::Vector2d& pattern_m, size_t most,
                                         const std::vector<PatternPixel>& instead) {
  std::vector<PatternPixel> near;
  for (size_t i = 0; i < pattern.points().size(); ++i) {
    if (seen.Sees(i)) near.emplace_back(pattern.points()[i], seen.pixels[i]);
  }
  if (near.size() < kFewPoints) near.insert(near.end(), instead.begin(), instead.end());
  const auto count = static_cast<ptrdiff_t>(std::min(most, near.size()));
  const auto is_nearer = [&](const PatternPixel& a, const PatternPixel& b) {
    const double at_a = (a.first - pattern_m).squaredNorm();
    const double at_b = (b.first - pattern_m).squaredNorm();
    return std::make_tuple(at_a, a.first.x(), a.first.y()) <
           std::make_tuple(at_b, b.first.x(), b.first.y());
  };
  std::partial_sort(near.begin(), near.begin() + count, near.end(), is_nearer);
  near.resize(static_cast<size_t>(count));
  return near;
}

}  // namespace rigcal::agent

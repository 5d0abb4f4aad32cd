// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "common/lens/board_view.h"
#include "common/lens/lens_adjustment.h"

namespace rigcal {

// The views of these numbers, and their poses.
struct ViewSubset {
  std::vector<BoardView> views;
  LensEstimate estimate;
};
template <typename Predicate>
ViewSubset Subset(const std::vector<BoardView>& views, const LensEstimate& estimate,
                  Predicate is_in) {
  ViewSubset subset;
  subset.estimate = estimate;
  subset.estimate.cam_from_board.clear();
  for (size_t i = 0; i < views.size(); ++i) {
    if (!is_in(i)) continue;
    subset.views.push_back(views[i]);
    subset.estimate.cam_from_board.push_back(estimate.cam_from_board[i]);
  }
  return subset;
}

// Root mean square; 0 of none.
double RmsOf(const std::vector<double>& errors);
double RmsOfAll(const std::vector<std::vector<double>>& errors);

// Distances of the corners of each view, px, with a lens that was solved without it: by fifths of
// the views. A corner at the border may have no ray by such a lens, so that 5 px are the most.
// `estimate` was solved with all of them; `max_steps` of each solve.
std::vector<std::vector<double>> HeldOutErrors(const std::vector<BoardView>& views,
                                               const LensEstimate& estimate, int max_steps);

// View by view, `a` is further off than `b`: the mean difference of their squares is more than 2.5
// times its standard error.
bool IsWorse(const std::vector<std::vector<double>>& a, const std::vector<std::vector<double>>& b);

}  // namespace rigcal

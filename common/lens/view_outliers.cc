// SPDX-License-Identifier: Apache-2.0
#include "common/lens/view_outliers.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_format.h"
#include "common/statistics/robust_statistics.h"

namespace rigcal {
namespace {

constexpr double kOutlierSigmas = 6;
constexpr double kLeastOutlierPx = 0.05;
constexpr double kOutlierViewRatio = 5;  // of the median of all views
constexpr double kLeastOutlierViewPx = 0.3;

}  // namespace

std::vector<BoardView> UsedCorners::Of(const std::vector<BoardView>& views) const {
  std::vector<BoardView> used;
  for (size_t i = 0; i < views.size(); ++i) {
    if (!left_out[i].empty()) continue;
    BoardView& view = used.emplace_back();
    view.name = views[i].name;
    for (size_t k = 0; k < views[i].corners.size(); ++k) {
      if (corners[i][k]) view.corners.push_back(views[i].corners[k]);
    }
  }
  return used;
}

LensEstimate UsedCorners::Of(const LensEstimate& all) const {
  LensEstimate used = all;
  used.cam_from_board.clear();
  for (size_t i = 0; i < left_out.size(); ++i) {
    if (left_out[i].empty()) used.cam_from_board.push_back(all.cam_from_board[i]);
  }
  return used;
}

void UsedCorners::Into(const LensEstimate& fitted, LensEstimate* all) const {
  all->intrinsics = fitted.intrinsics;
  for (size_t i = 0, at = 0; i < left_out.size(); ++i) {
    if (left_out[i].empty()) all->cam_from_board[i] = fitted.cam_from_board[at++];
  }
}

UsedCorners LeaveOutWrong(const std::vector<BoardView>& views, const LensEstimate& estimate) {
  std::vector<std::vector<double>> errors;
  std::vector<double> medians;
  for (size_t i = 0; i < views.size(); ++i) {
    errors.push_back(CornerErrors(views[i], estimate.intrinsics, estimate.cam_from_board[i]));
    medians.push_back(UpperMedian(errors.back()));
  }
  const double typical = UpperMedian(medians);
  UsedCorners used;
  std::vector<double> of_used;
  for (size_t i = 0; i < views.size(); ++i) {
    std::string why;
    if (medians[i] > std::max(kOutlierViewRatio * typical, kLeastOutlierViewPx)) {
      why =
          absl::StrFormat("does not fit the others: corners are off by %.2f px, elsewhere by %.2f",
                          medians[i], typical);
    } else {
      of_used.insert(of_used.end(), errors[i].begin(), errors[i].end());
    }
    used.left_out.push_back(std::move(why));
  }
  const double sigma = UpperMedian(std::move(of_used)) / kMedianOfRayleigh;
  const double limit = std::max(kOutlierSigmas * sigma, kLeastOutlierPx);
  for (size_t i = 0; i < views.size(); ++i) {
    auto& corners = used.corners.emplace_back();
    for (const double error : errors[i]) corners.push_back(error <= limit);
    const auto good = static_cast<size_t>(std::count(corners.begin(), corners.end(), true));
    if (used.left_out[i].empty() &&
        (good < kLeastCornersOfView || 2 * good < views[i].corners.size())) {
      used.left_out[i] = absl::StrFormat("only %d of its %d corners fit", good, corners.size());
    }
  }
  return used;
}

}  // namespace rigcal

// SPDX-License-Identifier: Apache-2.0
#include "common/lens/held_out_views.h"

#include <algorithm>
#include <cmath>

namespace rigcal {
namespace {

constexpr size_t kFolds = 5;
constexpr double kMostHeldOutPx = 5;
constexpr double kSystematic = 2.5;  // standard errors

}  // namespace

double RmsOf(const std::vector<double>& errors) {
  double sum = 0;
  for (const double error : errors) sum += error * error;
  return errors.empty() ? 0 : std::sqrt(sum / static_cast<double>(errors.size()));
}

std::vector<std::vector<double>> HeldOutErrors(const std::vector<BoardView>& views,
                                               const LensEstimate& estimate, int max_steps) {
  const size_t folds = std::min(kFolds, views.size());
  std::vector<std::vector<double>> errors(views.size());
  for (size_t fold = 0; fold < folds; ++fold) {
    const ViewSubset training =
        Subset(views, estimate, [&](size_t i) { return i % folds != fold; });
    ViewSubset held_out = Subset(views, estimate, [&](size_t i) { return i % folds == fold; });
    LensAdjustmentOptions options;
    options.max_steps = max_steps;
    held_out.estimate.intrinsics =
        AdjustLens(training.views, training.estimate, options).estimate.intrinsics;
    options.fix_intrinsics = true;
    const LensAdjustment placed = AdjustLens(held_out.views, held_out.estimate, options);
    for (size_t k = 0; k < held_out.views.size(); ++k) {
      std::vector<double>& of_view = errors[fold + k * folds];
      of_view = CornerErrors(held_out.views[k], placed.estimate.intrinsics,
                             placed.estimate.cam_from_board[k]);
      for (double& error : of_view) error = std::min(error, kMostHeldOutPx);
    }
  }
  return errors;
}

double RmsOfAll(const std::vector<std::vector<double>>& errors) {
  std::vector<double> all;
  for (const auto& of_view : errors) all.insert(all.end(), of_view.begin(), of_view.end());
  return RmsOf(all);
}

bool IsWorse(const std::vector<std::vector<double>>& a, const std::vector<std::vector<double>>& b) {
  const double count = static_cast<double>(a.size());
  double sum = 0, squares = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    const double rms_a = RmsOf(a[i]), rms_b = RmsOf(b[i]);
    const double difference = rms_a * rms_a - rms_b * rms_b;
    sum += difference;
    squares += difference * difference;
  }
  const double mean = sum / count;
  const double variance = std::max(0.0, squares / count - mean * mean) / (count - 1);
  return mean > kSystematic * std::sqrt(variance);
}

}  // namespace rigcal

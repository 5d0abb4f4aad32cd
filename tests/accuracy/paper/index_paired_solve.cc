// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/paper/index_paired_solve.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/solve/bundle/marker_residual_px.h"
#include "tests/accuracy/paper/paired_start.h"
#include "tests/bench/reference_bundle.h"

namespace rigcal::accuracy {
namespace {

constexpr size_t kMinInstants = 10;

using server::BundleInstant;
using server::BundleMarker;
using server::BundleObservation;
using server::BundleProblem;

bool SeesAll(const Observation& row, size_t markers) {
  return row.VisibleCount() == static_cast<int>(markers);
}

// Row i of every camera, where all see the whole wand.
std::vector<PairedRows> PairByIndex(const server::CalibrationInput& input) {
  size_t row_count = input.tracks.front().observations.size();
  for (const server::CameraTrack& track : input.tracks) {
    row_count = std::min(row_count, track.observations.size());
  }
  const size_t markers = input.target.marker_positions_m.size();
  std::vector<PairedRows> instants;
  for (size_t i = 0; i < row_count; ++i) {
    PairedRows rows;
    for (size_t c = 0; c < input.tracks.size(); ++c) {
      const Observation& row = input.tracks[c].observations[i];
      if (SeesAll(row, markers)) rows.emplace_back(static_cast<int>(c), &row);
    }
    if (rows.size() == input.tracks.size()) instants.push_back(std::move(rows));
  }
  return instants;
}

void StoreResiduals(const BundleProblem& problem, std::vector<CalibratedCamera>* cameras) {
  std::vector<double> sums_px(cameras->size()), squares_px2(cameras->size());
  for (const BundleInstant& instant : problem.instants) {
    ForEachUsedMarker(
        problem, instant, [&](const BundleObservation& observation, const BundleMarker& marker) {
          const auto residual = server::MarkerResidualPx(problem, instant, observation, marker);
          if (!residual) return;
          const auto c = static_cast<size_t>(observation.camera);
          sums_px[c] += residual->norm();
          squares_px2[c] += residual->squaredNorm();
          ++(*cameras)[c].residuals.all.marker_count;
        });
  }
  for (size_t c = 0; c < cameras->size(); ++c) {
    Residuals& residuals = (*cameras)[c].residuals;
    residuals.all.mean_px = sums_px[c] / residuals.all.marker_count;
    residuals.all.rms_px = std::sqrt(squares_px2[c] / residuals.all.marker_count);
    residuals.inlier = residuals.all;
  }
}

}  // namespace

absl::StatusOr<CalibrationResult> SolveIndexPaired(const server::CalibrationInput& input) {
  if (input.target.kind != TargetKind::kWand || input.tracks.empty()) {
    return absl::InvalidArgumentError("the index-paired solve takes rows of a wand");
  }
  const std::vector<PairedRows> instants = PairByIndex(input);
  if (instants.size() < kMinInstants) {
    return absl::FailedPreconditionError(
        absl::StrCat("all ", input.tracks.size(), " cameras see the whole wand in ",
                     instants.size(), " rows of one index, fewer than ", kMinInstants));
  }
  RIGCAL_ASSIGN_OR_RETURN(BundleProblem problem, StartFromPairs(input, instants));
  server::BundleOptions options;
  options.robust = false;
  RIGCAL_ASSIGN_OR_RETURN(const server::BundleSummary summary,
                          testing::SolveReferenceBundle(options, &problem));
  if (!summary.converged) {
    return absl::FailedPreconditionError(absl::StrCat(
        "the index-paired solve has not converged in ", summary.iterations, " iterations"));
  }
  CalibrationResult result = ResultOf(input, problem);
  result.instant_count = static_cast<uint32_t>(instants.size());
  StoreResiduals(problem, &result.cameras);
  std::ranges::sort(result.cameras, {}, &CalibratedCamera::camera);
  return result;
}

}  // namespace rigcal::accuracy

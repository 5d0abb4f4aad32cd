// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/residual_vectors.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/statistics/robust_statistics.h"
#include "server/solve/bundle/marker_residual_px.h"

namespace rigcal::server {
namespace {

constexpr size_t kBins = 40;
constexpr double kShareInBins = 0.99;  // of the inliers, before the last bin
constexpr double kBinsPx[] = {0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5};

// Steps that no screen shows, so that the texts are short.
float Rounded(double value, double step) {
  return static_cast<float>(std::round(value / step) * step);
}

CameraResiduals::Vector ToVector(const Eigen::Vector2d& centre_px,
                                 const Eigen::Vector2d& residual_px, bool outlier) {
  return {Rounded(centre_px.x(), 0.01), Rounded(centre_px.y(), 0.01),
          Rounded(residual_px.x(), 0.001), Rounded(residual_px.y(), 0.001), outlier};
}

void AddEvenly(const std::vector<CameraResiduals::Vector>& all, size_t limit,
               std::vector<CameraResiduals::Vector>* chosen) {
  const size_t count = std::min(all.size(), limit);
  for (size_t i = 0; i < count; ++i) chosen->push_back(all[i * all.size() / count]);
}

double Length(const CameraResiduals::Vector& vector) {
  return std::hypot(vector.dx_px, vector.dy_px);
}

double ChooseBin(const std::vector<CameraResiduals::Vector>& inliers) {
  std::vector<double> lengths;
  for (const CameraResiduals::Vector& each : inliers) lengths.push_back(Length(each));
  const double most_px = lengths.empty() ? 1 : UpperQuantile(&lengths, kShareInBins);
  for (const double bin_px : kBinsPx) {
    if (bin_px * static_cast<double>(kBins - 1) >= most_px) return bin_px;
  }
  return std::ceil(most_px / static_cast<double>(kBins - 1));
}

std::vector<uint32_t> Histogram(const std::vector<CameraResiduals::Vector>& vectors,
                                double bin_px) {
  std::vector<uint32_t> counts(kBins, 0);
  for (const CameraResiduals::Vector& each : vectors) {
    const double bin = std::min(Length(each) / bin_px, static_cast<double>(kBins - 1));
    ++counts[static_cast<size_t>(bin)];
  }
  return counts;
}

}  // namespace

std::vector<CameraResiduals> CollectResiduals(const BundleProblem& problem,
                                              const ResidualVectorLimits& limits) {
  const size_t count = problem.cameras.size();
  std::vector<std::vector<CameraResiduals::Vector>> inliers(count), outliers(count);
  for (const BundleInstant& instant : problem.instants) {
    if (!instant.used) continue;
    for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
      const auto camera = static_cast<size_t>(observation.camera);
      for (const BundleMarker& marker : problem.MarkersOf(observation)) {
        const auto residual = MarkerResidualPx(problem, instant, observation, marker);
        if (!residual) continue;
        const Eigen::Vector2d centre_px = CentreAtInstantPx(problem, observation, marker);
        auto& list = marker.used ? inliers[camera] : outliers[camera];
        list.push_back(ToVector(centre_px, *residual, !marker.used));
      }
    }
  }
  const size_t wanted = limits.inliers_per_camera + limits.outliers_per_camera;
  const double share = std::min(1.0, static_cast<double>(limits.total) /
                                         static_cast<double>(std::max<size_t>(1, wanted * count)));
  const auto limit = [share](size_t vectors) {
    return static_cast<size_t>(share * static_cast<double>(vectors));
  };
  std::vector<CameraResiduals> residuals(count);
  for (size_t c = 0; c < count; ++c) {
    residuals[c].camera = problem.cameras[c].name;
    AddEvenly(inliers[c], limit(limits.inliers_per_camera), &residuals[c].vectors);
    AddEvenly(outliers[c], limit(limits.outliers_per_camera), &residuals[c].vectors);
    residuals[c].bin_px = ChooseBin(inliers[c]);
    residuals[c].inlier_counts = Histogram(inliers[c], residuals[c].bin_px);
    residuals[c].outlier_counts = Histogram(outliers[c], residuals[c].bin_px);
  }
  return residuals;
}

}  // namespace rigcal::server

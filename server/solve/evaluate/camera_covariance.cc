// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/camera_covariance.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <tuple>

#include "common/statistics/robust_statistics.h"

namespace rigcal::server {
namespace {

constexpr double kLowShare = 0.01, kHighShare = 0.99;

// Rows of the uncertainty, -1 for none, in the packed order.
std::vector<Eigen::Index> RowsOf(const BundleProblem& problem, int reference_camera,
                                 const RigUncertainty& uncertainty) {
  std::map<std::tuple<ReducedParameterKind, int, int>, Eigen::Index> row_of;
  for (size_t i = 0; i < uncertainty.parameters.size(); ++i) {
    const ReducedParameter& parameter = uncertainty.parameters[i];
    row_of[{parameter.kind, parameter.index, parameter.component}] = static_cast<Eigen::Index>(i);
  }
  std::vector<Eigen::Index> rows;
  const auto add = [&](ReducedParameterKind kind, int camera, int component) {
    const auto found = row_of.find({kind, camera, component});
    rows.push_back(found == row_of.end() ? -1 : found->second);
  };
  for (int c = 0; c < static_cast<int>(problem.cameras.size()); ++c) {
    const BundleCamera& camera = problem.cameras[static_cast<size_t>(c)];
    if (c != reference_camera) {
      for (int i = 0; i < 3; ++i) add(ReducedParameterKind::kRotation, c, i);
      for (int i = 0; i < 3; ++i) add(ReducedParameterKind::kTranslation, c, i);
    }
    if (camera.intrinsics_fixed) continue;
    for (int i = 0; i < static_cast<int>(camera.intrinsics.size()); ++i) {
      add(ReducedParameterKind::kIntrinsic, c, i);
    }
  }
  return rows;
}

}  // namespace

std::vector<double> PackCameraCovariance(const BundleProblem& problem, int reference_camera,
                                         const RigUncertainty& uncertainty) {
  const std::vector<Eigen::Index> rows = RowsOf(problem, reference_camera, uncertainty);
  std::vector<double> packed;
  packed.reserve(rows.size() * (rows.size() + 1) / 2);
  for (size_t i = 0; i < rows.size(); ++i) {
    for (size_t j = 0; j <= i; ++j) {
      packed.push_back(rows[i] < 0 || rows[j] < 0 ? 0
                                                  : uncertainty.shape_covariance(rows[i], rows[j]));
    }
  }
  return packed;
}

std::optional<WandVolume> MeasureWandVolume(const BundleProblem& problem) {
  std::array<std::vector<double>, 3> coordinates;
  for (const BundleInstant& instant : problem.instants) {
    if (!instant.used) continue;
    // The ends of the wand; the other markers are between them.
    for (const double s_m : {0.0, problem.target.marker_positions_m.back()}) {
      const Eigen::Vector3d point_m = instant.origin_m + s_m * instant.direction;
      for (int i = 0; i < 3; ++i) coordinates[static_cast<size_t>(i)].push_back(point_m[i]);
    }
  }
  if (coordinates[0].empty()) return std::nullopt;
  WandVolume volume;
  for (size_t i = 0; i < 3; ++i) {
    std::vector<double>& values = coordinates[i];
    volume.min_m[static_cast<Eigen::Index>(i)] = LowerQuantile(&values, kLowShare);
    volume.max_m[static_cast<Eigen::Index>(i)] = UpperQuantile(&values, kHighShare);
  }
  return volume;
}

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#include "server/solve/clocks/ray_paths.h"

#include <algorithm>

#include "common/camera/camera_model.h"
#include "server/solve/rig/image_motion.h"

namespace rigcal::server {
namespace {

constexpr double kMaxGapPeriods = 3.5;
constexpr int kMaxPaths = 16;  // of a target with many markers these, evenly chosen, are enough

}  // namespace

TrackPaths PathsOf(const AlignedTrack& track, const std::vector<int64_t>& times_ns,
                   int64_t origin_ns, int marker_count) {
  TrackPaths paths;
  const Intrinsics& intrinsics = *track.track.camera.intrinsics;
  paths.focal_px = 0.5 * (intrinsics.fx_px + intrinsics.fy_px);
  paths.gap_s = kMaxGapPeriods * track.period_s;
  paths.period_s = track.period_s;
  const int stride = 1 + (marker_count - 1) / kMaxPaths;
  for (int m = 0; m < marker_count; ++m) {
    if (m % stride != 0) {
      paths.markers.emplace_back();
      continue;
    }
    std::vector<int64_t> seen_ns;
    std::vector<Eigen::Vector2d> centres_px;
    const ObservationTable& rows = track.track.observations;
    const auto label = static_cast<size_t>(m);
    for (size_t i = 0; i < rows.size(); ++i) {
      if (!rows.IsVisible(i, label)) continue;
      seen_ns.push_back(times_ns[i] + rows.time_delta_ns(i, label));
      centres_px.push_back(rows.centre_px(i, label));
    }
    const std::vector<bool> is_outlier = FindOutlierCentres(seen_ns, centres_px, paths.gap_s);
    RayPath path;
    for (size_t i = 0; i < seen_ns.size(); ++i) {
      if (is_outlier[i]) continue;
      const absl::StatusOr<Eigen::Vector2d> ray = Undistort(intrinsics, centres_px[i]);
      if (!ray.ok()) continue;
      path.time_s.push_back(1e-9 * static_cast<double>(seen_ns[i] - origin_ns));
      path.ray.push_back(*ray);
    }
    paths.markers.push_back(std::move(path));
  }
  return paths;
}

std::optional<Eigen::Vector2d> At(const RayPath& path, double time_s, double gap_s) {
  const auto after = std::lower_bound(path.time_s.begin(), path.time_s.end(), time_s);
  const auto index = static_cast<size_t>(after - path.time_s.begin());
  if (index < 2 || index + 2 > path.time_s.size()) return std::nullopt;
  for (size_t i = index - 1; i <= index + 1; ++i) {
    const double step_s = path.time_s[i] - path.time_s[i - 1];
    // Markers with times of their own may meet: no cubic goes through two rows at one time.
    if (step_s <= 0 || step_s > gap_s) return std::nullopt;
  }
  Eigen::Vector2d value = Eigen::Vector2d::Zero();
  for (size_t i = index - 2; i < index + 2; ++i) {
    double weight = 1;
    for (size_t j = index - 2; j < index + 2; ++j) {
      if (j != i) weight *= (time_s - path.time_s[j]) / (path.time_s[i] - path.time_s[j]);
    }
    value += weight * path.ray[i];
  }
  return value;
}

}  // namespace rigcal::server

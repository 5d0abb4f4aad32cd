// SPDX-License-Identifier: Apache-2.0
#include "common/origin/still_points.h"

#include <algorithm>
#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/status/status_macros.h"
#include "common/triangulate/camera_agreement.h"
#include "common/triangulate/point_fit.h"

namespace rigcal {
namespace {

constexpr size_t kMinInstantsOfPlace = 5;
constexpr double kSamePlaceM = 0.01;
// A marker may be hidden for a moment.
constexpr double kLongestGapS = 0.5;

// The triangulated markers of one instant, and of a run of instants.
struct StillInstant {
  int64_t time_ns = 0;
  std::map<int, const TriangulatedPoint*> points;  // by marker
};
struct StillRun {
  std::vector<const StillInstant*> instants;
  std::map<int, Eigen::Vector3d> first_m;  // by marker

  bool Accepts(const StillInstant& instant, double max_move_m) const {
    if (!instants.empty() &&
        1e-9 * static_cast<double>(instant.time_ns - instants.back()->time_ns) > kLongestGapS) {
      return false;
    }
    return std::ranges::all_of(instant.points, [&](const auto& entry) {
      const auto known = first_m.find(entry.first);
      if (known == first_m.end()) return true;
      // Noise that is larger than the limit is no motion.
      const double limit_m = max_move_m + 4 * std::sqrt(entry.second->noise_m2.trace());
      return (entry.second->position_m - known->second).norm() <= limit_m;
    });
  }
  void Add(const StillInstant& instant) {
    instants.push_back(&instant);
    for (const auto& [marker, point] : instant.points) first_m.emplace(marker, point->position_m);
  }
  double DurationS() const {
    return instants.empty()
               ? 0
               : 1e-9 * static_cast<double>(instants.back()->time_ns - instants.front()->time_ns);
  }
};

std::vector<StillInstant> InstantsOf(const Triangulation& triangulation) {
  std::vector<StillInstant> instants;
  for (const TriangulatedPoint& point : triangulation.points) {
    if (instants.empty() || instants.back().time_ns != point.rig_time_ns) {
      instants.push_back({point.rig_time_ns, {}});
    }
    instants.back().points[point.marker] = &point;
  }
  return instants;
}

// The mean of each camera's centres of a marker.
std::vector<PixelView> MeanViews(const std::vector<const TriangulatedPoint*>& points) {
  struct Sum {
    Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
    Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Zero();
    int count = 0;
  };
  std::map<int, Sum> sums;  // by camera
  for (const TriangulatedPoint* point : points) {
    for (const PixelView& view : point->views) {
      Sum& sum = sums[view.camera];
      sum.centre_px += view.centre_px;
      sum.covariance_px2 += view.covariance_px2;
      ++sum.count;
    }
  }
  std::vector<PixelView> views;
  for (const auto& [camera, sum] : sums) {
    const double rows = std::min<double>(sum.count, kMaxRowsOfStillCentre);
    views.push_back({camera, sum.centre_px / sum.count, sum.covariance_px2 / sum.count / rows});
  }
  return views;
}

}  // namespace

absl::StatusOr<std::vector<StillPoint>> FindStillPoints(
    const CalibrationResult& calibration, const std::vector<CameraRows>& rows,
    const StillOptions& options, std::map<std::string, uint32_t>* left_out_rows) {
  RIGCAL_ASSIGN_OR_RETURN(const Triangulation triangulation,
                          TriangulateRows(calibration, rows, options.triangulation));
  RIGCAL_RETURN_IF_ERROR(CheckCamerasAgree(calibration, triangulation));
  if (left_out_rows != nullptr) *left_out_rows = triangulation.left_out_rows;
  const std::vector<StillInstant> instants = InstantsOf(triangulation);
  std::vector<StillRun> places;
  double longest_s = 0;
  const auto close = [&](const StillRun& run) {
    longest_s = std::max(longest_s, run.DurationS());
    if (run.DurationS() < options.min_still_s || run.instants.size() < kMinInstantsOfPlace) return;
    for (StillRun& place : places) {
      const bool same = std::ranges::all_of(run.first_m, [&place](const auto& entry) {
        const auto known = place.first_m.find(entry.first);
        return known != place.first_m.end() && (known->second - entry.second).norm() < kSamePlaceM;
      });
      if (!same) continue;
      for (const StillInstant* instant : run.instants) place.Add(*instant);
      return;
    }
    places.push_back(run);
  };
  StillRun run;
  for (const StillInstant& instant : instants) {
    if (!run.Accepts(instant, options.max_move_m)) {
      close(run);
      run = {};
    }
    run.Add(instant);
  }
  close(run);
  if (places.empty()) {
    return absl::FailedPreconditionError(absl::StrFormat(
        "the target rests nowhere for %.2g s (the longest rest is %.2g s at %d instants); lay it "
        "down and let go",
        options.min_still_s, longest_s, instants.size()));
  }

  const CameraCovariance covariance = UnpackCameraCovariance(calibration);
  std::vector<StillPoint> still;
  for (size_t p = 0; p < places.size(); ++p) {
    std::map<int, std::vector<const TriangulatedPoint*>> by_marker;
    for (const StillInstant* instant : places[p].instants) {
      for (const auto& [marker, point] : instant->points) by_marker[marker].push_back(point);
    }
    for (const auto& [marker, points] : by_marker) {
      if (points.size() < kMinInstantsOfPlace) continue;
      const std::vector<PixelView> views = MeanViews(points);
      const std::optional<FittedPoint> fitted = FitPoint(calibration.cameras, views);
      if (!fitted) continue;
      StillPoint& point = still.emplace_back();
      point.place = static_cast<int>(p);
      point.marker = marker;
      point.from_s = 1e-9 * static_cast<double>(places[p].instants.front()->time_ns);
      point.to_s = 1e-9 * static_cast<double>(places[p].instants.back()->time_ns);
      point.position_m = fitted->position_m;
      point.noise_m2 = fitted->noise_m2;
      point.gain = covariance.matrix.size() > 0
                       ? PointGain(calibration.cameras, covariance, views, *fitted)
                       : Eigen::Matrix3Xd(3, 0);
      point.camera_count = static_cast<int>(views.size());
      point.views = views;
    }
  }
  return still;
}

}  // namespace rigcal

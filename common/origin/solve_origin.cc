// SPDX-License-Identifier: Apache-2.0
#include "common/origin/solve_origin.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/origin/still_points.h"
#include "common/status/status_macros.h"
#include "common/triangulate/camera_agreement.h"
#include "common/triangulate/located_markers.h"

namespace rigcal {
namespace {

constexpr size_t kMaxPathPoints = 150;
constexpr double kDegreesPerRadian = 57.29577951308232;

OriginOptions LimitsOf(const OriginRequest& request) {
  OriginOptions options;
  options.max_residual_m =
      request.max_residual_m > 0 ? request.max_residual_m : kDefaultMaxResidualM;
  options.max_rotation_sigma_deg =
      kDegreesPerRadian * (request.max_rotation_sigma_rad > 0 ? request.max_rotation_sigma_rad
                                                              : kDefaultMaxRotationSigmaRad);
  options.cameras_above = !request.cameras_below;
  return options;
}

OriginPoint PointOf(std::string name, const LocatedMarker& marker) {
  return {std::move(name), marker.position_m, marker.noise_m2, marker.gain, 0};
}

absl::StatusOr<OriginSolution> OriginOfFloor(const CalibrationResult& calibration,
                                             const OriginRequest& request,
                                             const std::vector<LocatedMarker>& located) {
  std::vector<OriginPoint> points;
  size_t second = 0;
  for (const LocatedMarker& marker : located) {
    if (marker.place == located.front().place) second = points.size();
    points.push_back(
        PointOf(absl::StrCat("marker ", marker.marker, " at place ", marker.place + 1), marker));
  }
  return FloorOrigin(calibration, points, 0, second, request.height_m, LimitsOf(request));
}

// x points to the point that is farthest from the first.
absl::StatusOr<OriginSolution> OriginOfPath(const CalibrationResult& calibration,
                                            const OriginRequest& request,
                                            const std::vector<LocatedMarker>& located) {
  std::vector<OriginPoint> points;
  size_t farthest = 0;
  for (const LocatedMarker& marker : located) {
    points.push_back(PointOf(absl::StrCat("marker ", marker.marker, " at ",
                                          1e-9 * static_cast<double>(marker.rig_time_ns), " s"),
                             marker));
    const auto away = [&](size_t i) {
      return (points[i].position_m - points.front().position_m).norm();
    };
    if (away(points.size() - 1) > away(farthest)) farthest = points.size() - 1;
  }
  return FloorOrigin(calibration, points, 0, farthest, request.height_m, LimitsOf(request));
}

// The marker that a point is.
int MarkerOfPoint(const std::vector<TargetPoint>& points, size_t index,
                  const std::vector<std::string>& labels) {
  const bool all_labelled = std::ranges::all_of(points, [&labels](const TargetPoint& point) {
    return std::ranges::find(labels, point.label) != labels.end();
  });
  if (labels.empty() || !all_labelled) return static_cast<int>(index);
  return static_cast<int>(std::ranges::find(labels, points[index].label) - labels.begin());
}

absl::StatusOr<OriginSolution> OriginOfPoints(const CalibrationResult& calibration,
                                              const OriginRequest& request,
                                              const std::vector<LocatedMarker>& located,
                                              const std::vector<std::string>& labels,
                                              std::vector<std::string>* unseen) {
  std::vector<OriginPoint> points;
  std::vector<Eigen::Vector3d> known_m;
  const auto add = [&](const TargetPoint& point, OriginPoint measured) {
    measured.name = point.label;
    measured.sigma_m = point.sigma_m;
    points.push_back(std::move(measured));
    known_m.emplace_back(point.x_m, point.y_m, point.z_m);
  };
  std::vector<const CalibratedTarget*> targets = {&calibration.target};
  for (const CalibratedTarget& other : calibration.other_targets) targets.push_back(&other);
  for (size_t i = 0; i < request.points.size(); ++i) {
    const TargetPoint& point = request.points[i];
    const size_t before = points.size();
    const int marker = MarkerOfPoint(request.points, i, labels);
    for (const LocatedMarker& seen : located) {
      if (seen.marker == marker && seen.place == 0) add(point, PointOf("", seen));
    }
    for (const CalibratedTarget* target : targets) {
      for (const CalibratedPoint& seen : target->static_points) {
        if (!located.empty() || seen.label != point.label) continue;
        add(point, {"", seen.position_m, Eigen::Matrix3d::Zero(), Eigen::Matrix3Xd(3, 0), 0});
      }
    }
    if (points.size() == before && unseen != nullptr) unseen->push_back(point.label);
  }
  return PointOrigin(calibration, points, known_m, LimitsOf(request));
}

}  // namespace

absl::StatusOr<std::vector<MarkerViews>> MeasureForOrigin(
    const CalibrationResult& calibration, const OriginRequest& request,
    const std::vector<CameraRows>& rows, const TriangulationOptions& options,
    std::map<std::string, uint32_t>* left_out_rows) {
  std::vector<MarkerViews> measured;
  if (request.source == FrameSource::kPath) {
    RIGCAL_ASSIGN_OR_RETURN(const Triangulation path, TriangulateRows(calibration, rows, options));
    RIGCAL_RETURN_IF_ERROR(CheckCamerasAgree(calibration, path));
    if (left_out_rows != nullptr) *left_out_rows = path.left_out_rows;
    const size_t stride = path.points.size() / kMaxPathPoints + 1;
    for (size_t i = 0; i < path.points.size(); i += stride) {
      const TriangulatedPoint& point = path.points[i];
      measured.push_back(
          {point.marker, 0, point.rig_time_ns, NamedViews(calibration, point.views)});
    }
    return measured;
  }
  StillOptions still;
  still.min_still_s = request.still_s > 0 ? request.still_s : kDefaultStillS;
  still.triangulation = options;
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<StillPoint> points,
                          FindStillPoints(calibration, rows, still, left_out_rows));
  for (const StillPoint& point : points) {
    measured.push_back({point.marker, point.place, static_cast<int64_t>(1e9 * point.from_s),
                        NamedViews(calibration, point.views)});
  }
  return measured;
}

absl::StatusOr<OriginSolution> SolveOrigin(const CalibrationResult& calibration,
                                           const OriginRequest& request,
                                           const std::vector<MarkerViews>& measured,
                                           const std::vector<std::string>& labels,
                                           std::vector<std::string>* unseen) {
  RIGCAL_RETURN_IF_ERROR(request.Validate());
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<LocatedMarker> located,
                          LocateMarkers(calibration, measured));
  const std::array<double, 4>& q = request.rotation_wxyz;
  const std::array<double, 3>& t = request.translation_m;
  switch (request.source) {
    case FrameSource::kFloor:
      return OriginOfFloor(calibration, request, located);
    case FrameSource::kPath:
      return OriginOfPath(calibration, request, located);
    case FrameSource::kPoints:
      return OriginOfPoints(calibration, request, located, labels, unseen);
    case FrameSource::kDown:
      return LevelOrigin(calibration,
                         Eigen::Vector3d(request.down[0], request.down[1], request.down[2]));
    default:
      return GivenOrigin(calibration, {Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized(),
                                       Eigen::Vector3d(t[0], t[1], t[2])});
  }
}

CalibrationResult WithOrigin(const CalibrationResult& calibration,
                             const std::string& calibration_id, FrameSource source,
                             const OriginSolution& solution) {
  CalibrationResult moved = ChangeFrame(calibration, solution.change);
  CalibrationFrame& frame = moved.frame.emplace();
  frame.source = source;
  frame.calibration_id = calibration_id;
  frame.new_from_rig = solution.change.new_from_rig;
  frame.rotation_sigma_rad = solution.rotation_sigma_rad;
  frame.position_sigma_m = solution.position_sigma_m;
  frame.residual_rms_m = solution.rms_m;
  frame.residual_count = static_cast<uint32_t>(solution.residuals.size());
  for (const OriginSolution::Residual& residual : solution.residuals) {
    if (frame.residuals.size() == kMaxPointResiduals) break;
    frame.residuals.push_back({residual.name, residual.residual_m, residual.sigma_m});
  }
  frame.lowest_camera = solution.lowest_camera;
  frame.lowest_camera_m = solution.lowest_camera_m;
  return moved;
}

}  // namespace rigcal

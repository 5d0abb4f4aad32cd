// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/solver/halves_experiment.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/camera/camera_model.h"
#include "common/camera/intrinsics_vector.h"
#include "common/statistics/robust_statistics.h"
#include "common/status/status_macros.h"
#include "server/solve/bundle/marker_residual_px.h"
#include "server/solve/evaluate/triangulation_accuracy.h"
#include "server/solve/geometry/triangulation.h"
#include "server/solve/rig/rig_solution.h"
#include "tests/accuracy/rig/simulated_tracks.h"
#include "tests/accuracy/rig/statistics.h"

namespace rigcal::accuracy {
namespace {

constexpr size_t kMaxPoints = 1000;

// First and last stamp of all tracks, seconds.
std::pair<double, double> SpanOf(const server::CalibrationInput& input) {
  int64_t first_ns = std::numeric_limits<int64_t>::max();
  int64_t last_ns = std::numeric_limits<int64_t>::min();
  for (const server::CameraTrack& track : input.tracks) {
    for (const Observation& row : track.observations) {
      first_ns = std::min(first_ns, row.time_ns);
      last_ns = std::max(last_ns, row.time_ns);
    }
  }
  return {1e-9 * static_cast<double>(first_ns), 1e-9 * static_cast<double>(last_ns)};
}

int PartAt(double time_s, const std::pair<double, double>& span_s, const PartsOptions& options) {
  const double length_s =
      options.block_s > 0 ? options.block_s : (span_s.second - span_s.first) / options.count;
  const auto block = static_cast<int>((time_s - span_s.first) / length_s);
  return options.block_s > 0 ? block % options.count : std::min(block, options.count - 1);
}

// In lengths of its own target: a pose of the shape.
RigidTransform ScaledPose(const CalibratedCamera& camera, double factor) {
  RigidTransform pose = camera.cam_from_rig;
  pose.translation_m *= factor;
  return pose;
}

void AddSquares(const Eigen::VectorXd& difference, const Eigen::VectorXd& sigma_a,
                const Eigen::VectorXd& sigma_b, std::vector<double>* to) {
  for (Eigen::Index i = 0; i < difference.size(); ++i) {
    const double variance = sigma_a[i] * sigma_a[i] + sigma_b[i] * sigma_b[i];
    if (variance > 0) to->push_back(difference[i] * difference[i] / variance);
  }
}

Eigen::VectorXd ToEigen(const std::vector<double>& values) {
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

void CompareCameras(const CalibratedCamera& a, const CalibratedCamera& b, double scale_b,
                    PartsDifference* result) {
  const CameraUncertainty &sigma_a = *a.uncertainty, &sigma_b = *b.uncertainty;
  const PoseError pose = ErrorOf(ScaledPose(b, scale_b), a.cam_from_rig);
  AddSquares(pose.position_m, sigma_a.position_sigma_m, sigma_b.position_sigma_m,
             &result->position);
  AddSquares(pose.rotation_rad, sigma_a.rotation_sigma_rad, sigma_b.rotation_sigma_rad,
             &result->rotation);
  if (a.intrinsics_refined && b.intrinsics_refined) {
    AddSquares(ToVector(b.intrinsics) - ToVector(a.intrinsics), ToEigen(sigma_a.intrinsics_sigma),
               ToEigen(sigma_b.intrinsics_sigma), &result->intrinsics);
  }
  // With rates the offsets of different times are compared, which have no joint sigma here.
  if (a.time_rate_ppm == 0 && b.time_rate_ppm == 0) {
    AddSquares(Eigen::VectorXd::Constant(1, b.time_offset_s - a.time_offset_s),
               Eigen::VectorXd::Constant(1, sigma_a.time_offset_sigma_s),
               Eigen::VectorXd::Constant(1, sigma_b.time_offset_sigma_s), &result->time_offset);
  }
}

double LengthM(const CalibrationResult& result) { return result.target.marker_positions_m.back(); }

// Where `by` places what `whole` sees of a point; none where fewer than two cameras see it.
std::optional<Eigen::Vector3d> PlaceAgain(const Eigen::Vector3d& point_m,
                                          const CalibrationResult& whole,
                                          const CalibrationResult& by) {
  std::vector<server::CameraRay> rays;
  for (size_t c = 0; c < whole.cameras.size(); ++c) {
    const CalibratedCamera& camera = whole.cameras[c];
    Eigen::Vector2d pixel;
    if (!Project(camera.intrinsics, camera.cam_from_rig * point_m, &pixel)) continue;
    if (!(pixel.minCoeff() >= -0.5) || !(pixel.x() < camera.image_size_px.width - 0.5) ||
        !(pixel.y() < camera.image_size_px.height - 0.5)) {
      continue;
    }
    const auto ray = Undistort(by.cameras[c].intrinsics, pixel);
    if (ray.ok()) rays.push_back({by.cameras[c].cam_from_rig, *ray});
  }
  return server::Triangulate(rays);
}

void ComparePoints(const CalibrationResult& a, const CalibrationResult& b,
                   const CalibrationResult& whole, const std::vector<Eigen::Vector3d>& points_m,
                   PartsDifference* result) {
  std::vector<Eigen::Vector3d> by_a, by_b;
  for (const Eigen::Vector3d& point_m : points_m) {
    const auto in_a = PlaceAgain(point_m, whole, a), in_b = PlaceAgain(point_m, whole, b);
    if (!in_a || !in_b) continue;
    by_a.push_back(*in_a / LengthM(a) * LengthM(whole));
    by_b.push_back(*in_b / LengthM(b) * LengthM(whole));
  }
  const auto count = static_cast<Eigen::Index>(by_a.size());
  if (count < 3) return;
  Eigen::Matrix3Xd from(3, count), to(3, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    from.col(i) = by_a[static_cast<size_t>(i)];
    to.col(i) = by_b[static_cast<size_t>(i)];
  }
  const Eigen::Matrix4d aligned = Eigen::umeyama(from, to, /*with_scaling=*/false);
  const Eigen::Matrix3Xd rest =
      to - ((aligned.topLeftCorner<3, 3>() * from).colwise() + aligned.topRightCorner<3, 1>());
  std::vector<double> distances_m;
  for (Eigen::Index i = 0; i < count; ++i) distances_m.push_back(rest.col(i).norm());
  result->points_rms_m = RootMeanSquare(distances_m);
  result->points_median_m = InterpolatedQuantile(distances_m, 0.5);
  result->points_p95_m = InterpolatedQuantile(distances_m, 0.95);
}

}  // namespace

server::CalibrationInput TakePart(const server::CalibrationInput& input,
                                  const PartsOptions& options, int part) {
  const auto span_s = SpanOf(input);
  server::CalibrationInput taken = input;
  for (server::CameraTrack& track : taken.tracks) {
    std::erase_if(track.observations, [&](const Observation& row) {
      return PartAt(1e-9 * static_cast<double>(row.time_ns), span_s, options) != part;
    });
  }
  return taken;
}

absl::StatusOr<PartsDifference> CompareParts(const CalibrationResult& a, const CalibrationResult& b,
                                             const CalibrationResult& whole,
                                             const std::vector<Eigen::Vector3d>& points_m) {
  if (a.cameras.size() != b.cameras.size() || a.cameras.size() != whole.cameras.size()) {
    return absl::InternalError("the parts have other cameras than the whole");
  }
  PartsDifference result;
  for (size_t c = 0; c < a.cameras.size(); ++c) {
    if (!a.cameras[c].uncertainty || !b.cameras[c].uncertainty) {
      return absl::InternalError(
          absl::StrCat("a part states no uncertainty of ", a.cameras[c].camera));
    }
    CompareCameras(a.cameras[c], b.cameras[c], LengthM(a) / LengthM(b), &result);
  }
  ComparePoints(a, b, whole, points_m, &result);
  server::AccuracyOptions at_points;
  at_points.points_m = points_m;
  double square_m2 = 0;
  for (const CalibrationResult* part : {&a, &b}) {
    RIGCAL_ASSIGN_OR_RETURN(const server::Accuracy accuracy,
                            server::ComputeAccuracy(*part, at_points));
    square_m2 += accuracy.calibration_rms_m * accuracy.calibration_rms_m;
  }
  result.predicted_rms_m = std::sqrt(square_m2);
  return result;
}

std::vector<Eigen::Vector3d> PlacedMarkers(const server::RigSolution& solution) {
  const server::BundleProblem& problem = solution.built.problem;
  std::vector<Eigen::Vector3d> points_m, chosen_m;
  for (const server::BundleInstant& instant : problem.instants) {
    if (!instant.used) continue;
    for (const double s_m : problem.target.marker_positions_m) {
      points_m.push_back(instant.origin_m + s_m * instant.direction);
    }
  }
  const size_t stride = std::max<size_t>(1, (points_m.size() + kMaxPoints - 1) / kMaxPoints);
  for (size_t i = 0; i < points_m.size(); i += stride) chosen_m.push_back(points_m[i]);
  return chosen_m;
}

Straightness MeasureStraightness(const server::RigSolution& solution) {
  const server::BundleProblem& problem = solution.built.problem;
  Straightness result;
  if (problem.target.marker_positions_m.size() != 3) return result;
  const std::vector<Intrinsics> intrinsics = server::CurrentIntrinsics(problem);
  std::vector<Eigen::Vector3d> offsets_m;
  for (const server::BundleInstant& instant : problem.instants) {
    std::array<std::vector<server::CameraRay>, 3> rays;
    server::ForEachUsedMarker(
        problem, instant,
        [&](const server::BundleObservation& observation, const server::BundleMarker& marker) {
          const auto ray = Undistort(intrinsics[static_cast<size_t>(observation.camera)],
                                     server::CentreAtInstantPx(problem, observation, marker));
          if (!ray.ok()) return;
          rays[static_cast<size_t>(marker.marker)].push_back(
              {problem.CameraOf(observation).cam_from_rig, *ray});
        });
    std::array<std::optional<Eigen::Vector3d>, 3> markers;
    for (size_t m = 0; m < 3; ++m) {
      if (rays[m].size() >= 3) markers[m] = server::Triangulate(rays[m]);
    }
    if (!markers[0] || !markers[1] || !markers[2]) continue;
    const Eigen::Vector3d along = (*markers[2] - *markers[0]).normalized();
    const Eigen::Vector3d middle = *markers[1] - *markers[0];
    offsets_m.push_back(middle - middle.dot(along) * along);
  }
  result.count = static_cast<int>(offsets_m.size());
  const auto correlation = [&offsets_m](size_t lag) {
    double product = 0, square = 0;
    for (size_t i = 0; i + lag < offsets_m.size(); ++i) {
      product += offsets_m[i].dot(offsets_m[i + lag]);
      square += 0.5 * (offsets_m[i].squaredNorm() + offsets_m[i + lag].squaredNorm());
    }
    return square > 0 ? product / square : 0;
  };
  double sum_m2 = 0;
  for (const Eigen::Vector3d& offset_m : offsets_m) sum_m2 += offset_m.squaredNorm();
  result.rms_m = std::sqrt(sum_m2 / std::max(1, result.count));
  result.next = correlation(1);
  result.later = correlation(20);
  return result;
}

absl::StatusOr<PartsTrial> RunParts(const server::CalibrationInput& input,
                                    const PartsOptions& options, const CalibrationResult& whole,
                                    const std::vector<Eigen::Vector3d>& points_m) {
  PartsTrial trial;
  for (int part = 0; part < options.count; ++part) {
    server::CalibrationOutcome outcome = server::Calibrate(TakePart(input, options, part), {});
    if (!outcome.result.ok()) {
      return absl::Status(
          outcome.result.status().code(),
          absl::StrCat("part ", part + 1, ": ", std::string(outcome.result.status().message())));
    }
    trial.parts.push_back(*std::move(outcome.result));
  }
  for (int i = 0; i < options.count; ++i) {
    for (int j = i + 1; j < options.count; ++j) {
      RIGCAL_ASSIGN_OR_RETURN(PartsDifference difference,
                              CompareParts(trial.parts[static_cast<size_t>(i)],
                                           trial.parts[static_cast<size_t>(j)], whole, points_m));
      trial.pairs.emplace_back(i, j);
      trial.differences.push_back(std::move(difference));
    }
  }
  return trial;
}

}  // namespace rigcal::accuracy

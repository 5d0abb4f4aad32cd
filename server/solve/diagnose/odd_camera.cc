// SPDX-License-Identifier: Apache-2.0
#include "server/solve/diagnose/odd_camera.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "absl/strings/str_format.h"
#include "common/camera/camera_model.h"
#include "common/statistics/robust_statistics.h"
#include "server/solve/bundle/marker_residual_px.h"
#include "server/solve/clocks/ray_paths.h"
#include "server/solve/diagnose/others_points.h"
#include "server/solve/evaluate/resection.h"
#include "server/solve/initialize/shared_views.h"
#include "server/solve/rig/rig_solver.h"

namespace rigcal::server {
namespace {

constexpr size_t kMaxCandidates = 10;
constexpr size_t kMinCameras = 4;
constexpr size_t kJudgedPoints = 600;
constexpr size_t kMinJudgedPoints = 60;
constexpr double kOddReachS = 0.5, kOddStepS = 0.02;
// The others must agree like this.
constexpr double kSoundPx = 2, kSoundOutliers = 0.2;
constexpr int kSoundViews = 8;
// Median error of a camera that fits, and of one that is noise around the right place.
constexpr double kFitsPx = 3, kNoisePx = 20;
// By which a mirrored image must fit better.
constexpr double kMirrorGain = 0.4;
constexpr double kResectThresholdPx = 12;
constexpr double kMinAgreeing = 0.3;
constexpr double kNoPosePx = 100;  // where no pose is found at all

double RootErrorPx(const BundleProblem& problem, size_t camera) {
  std::vector<double> errors_px;
  for (const BundleInstant& instant : problem.instants) {
    ForEachUsedMarker(
        problem, instant, [&](const BundleObservation& observation, const BundleMarker& marker) {
          if (static_cast<size_t>(observation.camera) != camera) return;
          const auto residual = MarkerResidualPx(problem, instant, observation, marker);
          if (residual) errors_px.push_back(residual->norm());
        });
  }
  return errors_px.empty() ? 0 : UpperMedian(&errors_px);
}

// Every camera's markers agree, but for a few.
bool IsSound(const BundleProblem& problem) {
  if (!DescribeLostCameras(problem, kSoundViews).empty()) return false;
  std::vector<int> all(problem.cameras.size(), 0), used(problem.cameras.size(), 0);
  for (const BundleInstant& instant : problem.instants) {
    for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
      for (const BundleMarker& marker : problem.MarkersOf(observation)) {
        ++all[static_cast<size_t>(observation.camera)];
        used[static_cast<size_t>(observation.camera)] += marker.used && instant.used ? 1 : 0;
      }
    }
  }
  for (size_t c = 0; c < all.size(); ++c) {
    if (RootErrorPx(problem, c) > kSoundPx) return false;
    if (used[c] < (1 - kSoundOutliers) * all[c]) return false;
  }
  return true;
}

// The path as its camera would have seen it in a mirror.
TrackPaths MirroredPaths(TrackPaths paths, const Intrinsics& given, const ImageSize& size) {
  for (RayPath& path : paths.markers) {
    RayPath mirrored;
    for (size_t i = 0; i < path.ray.size(); ++i) {
      Eigen::Vector2d pixel;
      if (!Project(given, path.ray[i].homogeneous(), &pixel)) continue;
      pixel.x() = size.width - 1 - pixel.x();
      const absl::StatusOr<Eigen::Vector2d> ray = Undistort(given, pixel);
      if (!ray.ok()) continue;
      mirrored.time_s.push_back(path.time_s[i]);
      mirrored.ray.push_back(*ray);
    }
    path = std::move(mirrored);
  }
  return paths;
}

// Median error of the best pose over the offsets, all points counted; infinite: none fits.
double BestResectionPx(const std::vector<TimedMarker>& points, const TrackPaths& paths,
                       int64_t origin_ns) {
  double best_px = std::numeric_limits<double>::infinity();
  const int steps = static_cast<int>(kOddReachS / kOddStepS);
  for (int i = -steps; i <= steps; ++i) {
    std::vector<PointAndRay> sights;
    for (const TimedMarker& point : points) {
      // Of another session's wand.
      if (static_cast<size_t>(point.marker) >= paths.markers.size()) continue;
      const double time_s = 1e-9 * static_cast<double>(point.rig_time_ns - origin_ns);
      const auto ray =
          At(paths.markers[static_cast<size_t>(point.marker)], time_s - i * kOddStepS, paths.gap_s);
      if (ray) sights.push_back({point.x_in_rig, *ray});
    }
    if (sights.size() < kMinJudgedPoints) continue;
    const auto pose = Resect(sights, kResectThresholdPx / paths.focal_px, kMinAgreeing);
    if (!pose) continue;
    std::vector<double> errors_px;
    for (const PointAndRay& sight : sights) {
      errors_px.push_back(paths.focal_px * RayError({*pose, sight.ray}, sight.x_in_rig));
    }
    best_px = std::min(best_px, UpperMedian(&errors_px));
  }
  return best_px;
}

// `own`: the rig with the camera; `solution`: of any rig in whose times its rows are.
OddCamera Judge(const RigObservations& own, const std::vector<ClockCorrection>& clocks,
                const RigSolution& solution, const std::vector<TimedMarker>& points,
                const std::string& camera, double others_px) {
  OddCamera odd;
  odd.camera = camera;
  if (points.size() < kMinJudgedPoints) return odd;
  const auto times = RigTimes(own.tracks, own.index, clocks);
  const int64_t origin_ns = solution.built.instant_time_ns.front();
  odd.error_px = odd.mirrored_px = std::numeric_limits<double>::infinity();
  const TargetParts parts = own.Parts();
  bool judged = false;
  for (size_t t = 0; t < own.tracks.size(); ++t) {
    const CameraDescription& description =
        own.index.cameras[static_cast<size_t>(own.index.camera_of_track[t])];
    // The points are of a line target alone, and followed through time.
    if (description.camera != camera || own.tracks[t].is_static ||
        parts.Of(own.tracks[t].track.session_id).is_rigid) {
      continue;
    }
    judged = true;
    const TrackPaths paths =
        PathsOf(own.tracks[t], times[t], origin_ns, own.TargetOf(t).marker_count());
    odd.error_px = std::min(odd.error_px, BestResectionPx(points, paths, origin_ns));
    if (odd.error_px < kFitsPx) continue;
    odd.mirrored_px = std::min(
        odd.mirrored_px,
        BestResectionPx(points,
                        MirroredPaths(paths, *description.intrinsics, description.image_size_px),
                        origin_ns));
  }
  if (!judged) {
    odd.error_px = odd.mirrored_px = 0;
    return odd;
  }
  odd.error_px = std::min(odd.error_px, kNoPosePx);
  odd.mirrored_px = std::min(odd.mirrored_px, kNoPosePx);
  if (odd.error_px < kFitsPx && odd.error_px < 4 * std::max(0.3, others_px)) return odd;
  if (odd.mirrored_px < 2 * kFitsPx && odd.mirrored_px < kMirrorGain * odd.error_px) {
    odd.kind = FindingKind::kMirroredImage;
    odd.advice = absl::StrFormat(
        "its image is mirrored: as it is no pose agrees with what the other cameras see, mirrored "
        "one does, to %.1f px (median). Switch off the mirroring in its driver or its optics and "
        "record again, or leave it out",
        odd.mirrored_px);
  } else if (odd.error_px < kNoisePx) {
    odd.kind = FindingKind::kNoisyCamera;
    odd.advice = absl::StrFormat(
        "its centres have a noise of about %.1f px (one sigma; the others: %.2f px). Check its "
        "focus, exposure and detector, or leave it out",
        odd.error_px / kMedianOfRayleigh, others_px / kMedianOfRayleigh);
  } else {
    odd.kind = FindingKind::kInconsistentCamera;
    odd.advice =
        "it agrees with the other cameras in no pose and at no time within 0.5 s, as it is or "
        "mirrored, while they agree with each other: leave it out, and check that its rows are of "
        "this recording, that it sees the same wand, and that its calibration file is its own";
  }
  return odd;
}

double MedianErrorPx(const BundleProblem& problem, const std::string& without) {
  std::vector<double> errors_px;
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    if (problem.cameras[c].name != without) errors_px.push_back(RootErrorPx(problem, c));
  }
  return errors_px.empty() ? 0 : Median(errors_px);
}

}  // namespace

OddCamera JudgeCamera(const RigObservations& rig, const RigSolution& solution,
                      const std::string& camera) {
  const BundleProblem& problem = solution.built.problem;
  const std::vector<TimedMarker> points = MarkersSeenBy(
      problem, solution.built.instant_time_ns,
      [&](const BundleObservation& seen) { return problem.CameraOf(seen).name != camera; },
      kJudgedPoints);
  return Judge(rig, InitializationFrom(solution).clocks, solution, points, camera,
               MedianErrorPx(problem, camera));
}

RigObservations WithoutCamera(const RigObservations& rig,
                              const std::vector<ClockCorrection>& clocks, size_t camera,
                              std::vector<ClockCorrection>* remaining) {
  RigObservations rest;
  rest.target = rig.target;
  rest.other_targets = rig.other_targets;
  for (size_t t = 0; t < rig.tracks.size(); ++t) {
    if (rig.index.camera_of_track[t] == static_cast<int>(camera)) continue;
    rest.tracks.push_back(rig.tracks[t]);
  }
  rest.index = IndexRig(rest.tracks, remaining);
  for (size_t t = 0, own = 0; t < rig.tracks.size(); ++t) {
    if (rig.index.camera_of_track[t] == static_cast<int>(camera)) continue;
    (*remaining)[static_cast<size_t>(rest.index.clock_of_track[own++])] =
        clocks[static_cast<size_t>(rig.index.clock_of_track[t])];
  }
  return rest;
}

OddCamera FindOddCamera(const RigObservations& rig, const std::vector<ClockCorrection>& clocks,
                        const RigSolveOptions& options) {
  const size_t count = rig.index.cameras.size();
  if (count < kMinCameras) return {};
  for (size_t c = 0; c < std::min(count, kMaxCandidates); ++c) {
    std::vector<ClockCorrection> remaining;
    const RigObservations rest = WithoutCamera(rig, clocks, c, &remaining);
    RigSolveOptions without = options;
    const std::string& reference =
        rig.index.cameras[static_cast<size_t>(options.reference_camera)].camera;
    const auto found = std::ranges::find(rest.index.cameras, reference, &CameraDescription::camera);
    without.reference_camera = found == rest.index.cameras.end()
                                   ? 0
                                   : static_cast<int>(found - rest.index.cameras.begin());
    // A distance may be to the camera that is left out; without one the unit does not matter here.
    without.known_distance.reset();
    // What is said camera by camera goes with the cameras that are left.
    if (c < without.keep_intrinsics.size()) {
      without.keep_intrinsics.erase(without.keep_intrinsics.begin() +
                                    static_cast<std::ptrdiff_t>(c));
    }
    without.own_rates.clear();
    without.camera_notes.clear();
    without.progress = nullptr;
    const absl::StatusOr<RigSolution> solution = SolveRig(rest, remaining, without);
    if (absl::IsCancelled(solution.status())) return {};
    if (!solution.ok() || !IsSound(solution->built.problem)) continue;
    const std::vector<TimedMarker> points = MarkersSeenBy(
        solution->built.problem, solution->built.instant_time_ns,
        [](const BundleObservation&) { return true; }, kJudgedPoints);
    const OddCamera odd = Judge(rig, clocks, *solution, points, rig.index.cameras[c].camera,
                                MedianErrorPx(solution->built.problem, ""));
    if (odd.kind != FindingKind::kUnspecified) return odd;
  }
  return {};
}

}  // namespace rigcal::server

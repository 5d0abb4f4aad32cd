// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/held_out.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "common/camera/camera_model.h"
#include "server/solve/bundle/marker_residual_px.h"
#include "server/solve/geometry/marker_rays.h"
#include "server/solve/geometry/triangulation.h"
#include "server/solve/initialize/initialization.h"
#include "server/solve/rig/outliers.h"
#include "server/solve/rig/sphere_centres.h"
#include "server/solve/rig/thin_out.h"

namespace rigcal::server {
namespace {

constexpr size_t kMinErrorsToChoose = 30;

int64_t BlockOf(const TimeBlocks& blocks, int64_t rig_time_ns) {
  const int64_t since = rig_time_ns - blocks.origin_ns;
  return since >= 0 ? since / blocks.block_ns : -1 - (-since - 1) / blocks.block_ns;
}

// The instants of the problem, with the estimates of the solution, none of them placed yet.
BuiltProblem BuildForEvaluation(const RigObservations& rig, const RigSolution& solution,
                                const RigSolveOptions& options,
                                const std::function<bool(int64_t)>& select) {
  InstantList list =
      FindInstants(rig.tracks, RigTimes(rig.tracks, rig.index, solution.clocks, &solution.motions),
                   options.tolerance_s);
  std::erase_if(list.instants,
                [&select](const Instant& instant) { return !select(instant.rig_time_ns); });
  ThinOut(rig.index, options.max_observations, &list.instants);
  BuiltProblem built = BuildProblem(rig.Parts(), rig.tracks, solution.motions, rig.index,
                                    solution.clocks, list.instants, options.sigma_px);
  built.problem.cameras = solution.built.problem.cameras;
  built.problem.clocks = solution.built.problem.clocks;
  built.problem.target = solution.built.problem.target;
  built.problem.rigid_target = solution.built.problem.rigid_target;
  built.problem.distance = solution.built.problem.distance;
  for (BundleInstant& instant : built.problem.instants) instant.used = false;
  return built;
}

void LeaveOneOut(const BundleProblem& problem, const std::vector<Intrinsics>& intrinsics,
                 const BundleInstant& instant, EvaluatedErrors* errors) {
  const std::vector<MarkerRay> views = UsedMarkerRays(problem, intrinsics, instant);
  const auto compare = [&](const MarkerRay& left_out, const std::optional<Eigen::Vector3d>& point) {
    const auto camera = static_cast<size_t>(left_out.camera);
    Eigen::Vector2d pixel;
    if (point && Project(intrinsics[camera], left_out.ray.cam_from_rig * *point, &pixel)) {
      errors->leave_one_out_px[camera].push_back((pixel - left_out.centre_px).norm());
    }
  };
  for (size_t m = 0; m < problem.MarkerCount(); ++m) {
    std::vector<CameraRay> rays;
    std::vector<const MarkerRay*> seen;
    for (const MarkerRay& view : views) {
      if (view.marker != static_cast<int>(m) || !view.has_ray) continue;
      rays.push_back(view.ray);
      seen.push_back(&view);
    }
    const auto points = TriangulateWithoutEach(rays);
    for (size_t i = 0; i < seen.size(); ++i) compare(*seen[i], points[i]);
    for (const MarkerRay& view : views) {
      if (view.marker == static_cast<int>(m) && !view.has_ray) compare(view, Triangulate(rays));
    }
  }
}

// Infinite for too few errors.
double MeanOfMeans(const std::vector<std::vector<double>>& errors) {
  double sum = 0;
  int cameras = 0;
  size_t count = 0;
  for (std::vector<double> camera : errors) {
    if (camera.empty()) continue;
    std::ranges::sort(camera);
    sum += std::accumulate(camera.begin(), camera.end(), 0.0) / static_cast<double>(camera.size());
    count += camera.size();
    ++cameras;
  }
  return count < kMinErrorsToChoose ? std::numeric_limits<double>::infinity() : sum / cameras;
}

}  // namespace

bool TimeBlocks::IsHeldOut(int64_t rig_time_ns, int remainder) const {
  const int64_t block = BlockOf(*this, rig_time_ns);
  return ((block % period) + period) % period == remainder;
}

bool TimeBlocks::IsKept(int64_t rig_time_ns, int remainder) const {
  return !IsHeldOut(rig_time_ns, remainder) && !IsHeldOut(rig_time_ns - guard_ns, remainder) &&
         !IsHeldOut(rig_time_ns + guard_ns, remainder);
}

EvaluatedErrors EvaluateSolution(const RigObservations& rig, const RigSolution& solution,
                                 const RigSolveOptions& options,
                                 const std::function<bool(int64_t rig_time_ns)>& select) {
  BuiltProblem built = BuildForEvaluation(rig, solution, options, select);
  BundleProblem& problem = built.problem;
  EvaluatedErrors errors;
  errors.reprojection_px.resize(problem.cameras.size());
  errors.leave_one_out_px.resize(problem.cameras.size());
  errors.instant_count = PlaceInstants(kAgreePx, &problem);
  CorrectSphereCentres(rig.Parts(), rig.tracks, solution.motions, IsMetric(rig, options), &built);
  ClassifyOutliers(&problem);
  const std::vector<Intrinsics> intrinsics = CurrentIntrinsics(problem);
  for (const BundleInstant& instant : problem.instants) {
    if (!instant.used) continue;
    ForEachUsedMarker(
        problem, instant, [&](const BundleObservation& observation, const BundleMarker& marker) {
          const auto residual = MarkerResidualPx(problem, instant, observation, marker);
          if (!residual) return;
          errors.reprojection_px[static_cast<size_t>(observation.camera)].push_back(
              residual->norm());
        });
    LeaveOneOut(problem, intrinsics, instant, &errors);
  }
  errors.lengths = MeasureLengths(problem, problem.target.marker_positions_m, 3);
  return errors;
}

double ChoiceScorePx(const EvaluatedErrors& errors) {
  const double left_out_px = MeanOfMeans(errors.leave_one_out_px);
  return std::isfinite(left_out_px) ? left_out_px : MeanOfMeans(errors.reprojection_px);
}

}  // namespace rigcal::server

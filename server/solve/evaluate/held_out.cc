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

int64_t TimeBlocks::Block(int64_t rig_time_ns) const {
  const int64_t since = rig_time_ns - origin_ns;
  return since >= 0 ? since / block_ns : -1 - (-since - 1) / block_ns;
}

bool TimeBlocks::IsHeldOut(int64_t rig_time_ns, int remainder) const {
  const int64_t block = Block(rig_time_ns);
  return ((block % period) + period) % period == remainder;
}

bool TimeBlocks::IsKept(int64_t rig_time_ns, int remainder) const {
  return !IsHeldOut(rig_time_ns, remainder) && !IsHeldOut(rig_time_ns - guard_ns, remainder) &&
         !IsHeldOut(rig_time_ns + guard_ns, remainder);
}

std::vector<EvaluatedErrors> EvaluateParts(const RigObservations& rig, const RigSolution& solution,
                                           const RigSolveOptions& options, int parts,
                                           const std::function<int(int64_t rig_time_ns)>& part_of) {
  const auto is_part = [&](int64_t t) { return part_of(t) >= 0 && part_of(t) < parts; };
  BuiltProblem built = BuildForEvaluation(rig, solution, options, is_part);
  BundleProblem& problem = built.problem;
  std::vector<EvaluatedErrors> errors(static_cast<size_t>(parts));
  for (EvaluatedErrors& part : errors) {
    part.reprojection_px.resize(problem.cameras.size());
    part.leave_one_out_px.resize(problem.cameras.size());
  }
  PlaceInstants(kAgreePx, &problem);
  for (size_t i = 0; i < problem.instants.size(); ++i) {
    if (!problem.instants[i].used) continue;
    ++errors[static_cast<size_t>(part_of(built.instant_time_ns[i]))].instant_count;
  }
  CorrectSphereCentres(rig.Parts(), rig.tracks, solution.motions, IsMetric(rig, options), &built);
  ClassifyOutliers(&problem);
  const std::vector<Intrinsics> intrinsics = CurrentIntrinsics(problem);
  for (size_t i = 0; i < problem.instants.size(); ++i) {
    const BundleInstant& instant = problem.instants[i];
    if (!instant.used) continue;
    EvaluatedErrors& part = errors[static_cast<size_t>(part_of(built.instant_time_ns[i]))];
    ForEachUsedMarker(
        problem, instant, [&](const BundleObservation& observation, const BundleMarker& marker) {
          const auto residual = MarkerResidualPx(problem, instant, observation, marker);
          if (!residual) return;
          part.reprojection_px[static_cast<size_t>(observation.camera)].push_back(residual->norm());
        });
    LeaveOneOut(problem, intrinsics, instant, &part);
  }
  if (parts == 1) {
    errors[0].lengths = MeasureLengths(problem, problem.target.marker_positions_m, 3);
  }
  return errors;
}

EvaluatedErrors EvaluateSolution(const RigObservations& rig, const RigSolution& solution,
                                 const RigSolveOptions& options,
                                 const std::function<bool(int64_t rig_time_ns)>& select) {
  return EvaluateParts(rig, solution, options, 1,
                       [&select](int64_t t) { return select(t) ? 0 : -1; })[0];
}

double ChoiceScorePx(const EvaluatedErrors& errors) {
  const double left_out_px = MeanOfMeans(errors.leave_one_out_px);
  return std::isfinite(left_out_px) ? left_out_px : MeanOfMeans(errors.reprojection_px);
}

}  // namespace rigcal::server

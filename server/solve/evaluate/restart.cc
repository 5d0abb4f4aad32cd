// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/restart.h"

#include <algorithm>
#include <string>
#include <utility>

#include "absl/strings/str_format.h"
#include "server/solve/bundle/marker_residual_px.h"
#include "server/solve/evaluate/resection.h"
#include "server/solve/geometry/marker_rays.h"
#include "server/solve/geometry/target_pose.h"
#include "server/solve/geometry/triangulation.h"
#include "server/solve/rig/put_away.h"
#include "server/solve/rig/rig_solver.h"

namespace rigcal::server {
namespace {

constexpr double kAgreementPx = 4;
constexpr double kAgreementSigmas = 8;
constexpr double kDoubtShare = 0.6;
constexpr int kMinMarkers = 30;  // of a camera, to compute its share
constexpr int kMaxRestarts = 3;
constexpr double kTruncationPx = 20;    // of the errors that solutions are compared by
constexpr double kMustGainShare = 0.2;  // of that error must go
constexpr size_t kMaxPairInstants = 100;

// Markers as the trusted cameras triangulate them, and as `camera` sees them.
std::vector<PointAndRay> SightsOf(const BundleProblem& problem,
                                  const std::vector<Eigen::Vector2d>& rays,
                                  const std::vector<bool>& trusted, int camera) {
  std::vector<PointAndRay> sights;
  for (const BundleInstant& instant : problem.instants) {
    for (size_t k = 0; k < problem.MarkerCount(); ++k) {
      std::vector<CameraRay> views;
      std::vector<double> focal_px;
      std::optional<Eigen::Vector2d> own;
      for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
        const auto c = static_cast<size_t>(observation.camera);
        for (const BundleMarker& marker : problem.MarkersOf(observation)) {
          const size_t m = problem.IndexOf(marker);
          if (marker.marker != static_cast<int>(k) || !rays[m].allFinite()) continue;
          if (observation.camera == camera) own = rays[m];
          if (!trusted[c]) continue;
          views.push_back({problem.cameras[c].cam_from_rig, rays[m]});
          focal_px.push_back(problem.cameras[c].intrinsics[0]);
        }
      }
      const auto point = Triangulate(views);
      if (!own || !point) continue;
      bool agree = true;
      for (size_t v = 0; v < views.size(); ++v) {
        agree = agree && RayError(views[v], *point) * focal_px[v] < kAgreementPx;
      }
      if (agree) sights.push_back({*point, *own});
    }
  }
  return sights;
}

// The solution with the doubted cameras' poses from the others' markers; none where there are too
// few of either.
std::optional<RigInitialization> ResectedInitialization(
    const RigSolution& solution, const Agreement& agreement,
    const std::vector<ClockCorrection>& clocks) {
  const BundleProblem& problem = solution.built.problem;
  std::vector<bool> trusted(problem.cameras.size(), true);
  for (const int c : agreement.doubted) trusted[static_cast<size_t>(c)] = false;
  if (std::count(trusted.begin(), trusted.end(), true) < 2) return std::nullopt;
  const std::vector<Eigen::Vector2d> rays = UndistortMarkers(problem);
  RigInitialization initial = InitializationFrom(solution);
  initial.clocks = clocks;
  initial.instants.clear();
  // Of several fixed cameras each is where it is known to be.
  const bool are_held = std::ranges::count(problem.cameras, true, &BundleCamera::pose_fixed) > 1;
  bool any = false;
  for (const int c : agreement.doubted) {
    const BundleCamera& camera = problem.cameras[static_cast<size_t>(c)];
    if (are_held && camera.pose_fixed) continue;
    any = true;
    const auto pose =
        Resect(SightsOf(problem, rays, trusted, c), 2 * kAgreementPx / camera.intrinsics[0]);
    if (!pose) return std::nullopt;
    initial.cameras[static_cast<size_t>(c)].cam_from_rig = *pose;
  }
  if (!any) return std::nullopt;
  if (are_held) return initial;
  // The rig frame is where its camera says, also where that is one of those found anew.
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    if (!problem.cameras[c].pose_fixed) continue;
    const RigidTransform old_from_new =
        initial.cameras[c].cam_from_rig.Inverse() * problem.cameras[c].cam_from_rig;
    for (BundleCamera& camera : initial.cameras) {
      camera.cam_from_rig = camera.cam_from_rig * old_from_new;
    }
    initial.cameras[c].cam_from_rig = problem.cameras[c].cam_from_rig;
  }
  return initial;
}

// Share of the markers that two cameras show at once which fit the rigid target placed by these
// two.
double PairAgreement(const BundleProblem& problem, const std::vector<Eigen::Vector2d>& rays,
                     const std::pair<int, int>& pair) {
  std::vector<bool> has_pose(problem.cameras.size(), false);
  has_pose[static_cast<size_t>(pair.first)] = has_pose[static_cast<size_t>(pair.second)] = true;
  std::vector<const BundleInstant*> shared;
  for (const BundleInstant& instant : problem.instants) {
    const auto seen = std::ranges::count_if(
        problem.ObservationsOf(instant), [&has_pose](const BundleObservation& observation) {
          return has_pose[static_cast<size_t>(observation.camera)];
        });
    if (seen == 2) shared.push_back(&instant);
  }
  int agreeing = 0, all = 0;
  const size_t count = std::min(shared.size(), kMaxPairInstants);
  for (size_t i = 0; i < count; ++i) {
    const auto fit = EstimateTargetPose(problem, has_pose, rays, kAgreementPx,
                                        *shared[i * shared.size() / count]);
    agreeing += fit ? fit->inliers : 0;
    all += fit ? fit->markers : 2;
  }
  return all > 0 ? static_cast<double>(agreeing) / all : 0;
}

std::optional<std::pair<int, int>> WorstPair(const RigSolution& solution) {
  const std::vector<Eigen::Vector2d> rays = UndistortMarkers(solution.built.problem);
  std::optional<std::pair<int, int>> worst;
  double worst_share = 0;
  for (const std::pair<int, int>& pair : solution.spanning_tree) {
    const double share = PairAgreement(solution.built.problem, rays, pair);
    if (worst && share >= worst_share) continue;
    worst = pair;
    worst_share = share;
  }
  return worst;
}

Finding RestartedFinding(const BundleProblem& problem, const Agreement& before,
                         const Agreement& after, const std::string& how) {
  const auto worst = static_cast<size_t>(before.doubted.front());
  const std::string& name = problem.cameras[worst].name;
  return {FindingKind::kRestarted, name, after.error_px, "px",
          absl::StrFormat("the first solve had ended in a wrong minimum: %.0f %% of this camera's "
                          "markers agreed with it. Started again %s, %.0f %% agree, and the error "
                          "of all markers fell from %.1f to %.1f px. A wave that is flat, or "
                          "seldom seen by two cameras at once, has such minima: turn the wand and "
                          "move it in depth where %s and its neighbours see it",
                          100 * before.shares[worst], how, 100 * after.shares[worst],
                          before.error_px, after.error_px, name)};
}

}  // namespace

Agreement MeasureAgreement(const BundleProblem& problem) {
  std::vector<int> seen(problem.cameras.size(), 0), agreeing(problem.cameras.size(), 0);
  Agreement agreement;
  int count = 0;
  for (const BundleInstant& instant : problem.instants) {
    for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
      const auto c = static_cast<size_t>(observation.camera);
      for (const BundleMarker& marker : problem.MarkersOf(observation)) {
        const auto residual = MarkerResidualPx(problem, instant, observation, marker);
        const double error_px = residual ? residual->norm() : kTruncationPx;
        const bool agrees =
            residual && (error_px < kAgreementPx ||
                         (marker.sqrt_information * *residual).norm() < kAgreementSigmas);
        ++count;
        ++seen[c];
        agreeing[c] += agrees ? 1 : 0;
        // Not so as to let a NaN through.
        agreement.error_px += error_px < kTruncationPx ? error_px : kTruncationPx;
      }
    }
  }
  agreement.error_px /= std::max(1, count);
  for (size_t c = 0; c < seen.size(); ++c) {
    const bool enough = seen[c] >= kMinMarkers;
    agreement.shares.push_back(enough ? static_cast<double>(agreeing[c]) / seen[c] : 1);
    if (agreement.shares[c] < kDoubtShare) agreement.doubted.push_back(static_cast<int>(c));
  }
  std::ranges::stable_sort(agreement.doubted, {}, [&agreement](int c) {
    return agreement.shares[static_cast<size_t>(c)];
  });
  return agreement;
}

absl::StatusOr<std::optional<Finding>> RestartIfWrong(const RigObservations& rig,
                                                      const std::vector<ClockCorrection>& clocks,
                                                      const RigSolveOptions& solve,
                                                      RigSolution* solution) {
  std::optional<Finding> finding;
  const Agreement first = MeasureAgreement(solution->built.problem);
  Agreement best = first;
  RigSolveOptions again = solve;
  bool resect = true;
  // What the next initialization is to avoid: of the last one that began from other pairs.
  std::optional<std::pair<int, int>> misleading_pair;
  bool has_base = false;
  for (int i = 0; i < kMaxRestarts && !best.doubted.empty(); ++i) {
    std::optional<RigInitialization> initial;
    if (resect) initial = ResectedInitialization(*solution, best, clocks);
    resect = false;
    std::string how = "with its pose from what the other cameras see";
    if (!initial) {
      const auto pair = has_base ? misleading_pair : WorstPair(*solution);
      if (pair) again.avoided_pairs.push_back(*pair);
    }
    PutAway(rig, solve, solution);
    absl::StatusOr<RigSolution> tried = absl::UnknownError("not tried");
    if (initial) {
      tried = SolveRig(rig, clocks, again, &*initial);
    } else {
      again.seed = solve.seed + 0x9e3779b9u * static_cast<uint32_t>(i + 1);
      how = "from other pairs of cameras";
      tried = SolveRig(rig, clocks, again);
    }
    if (absl::IsCancelled(tried.status())) return tried.status();
    if (!tried.ok()) {
      TakeBack(rig, solve, solution);
      continue;
    }
    const Agreement now = MeasureAgreement(tried->built.problem);
    if (now.error_px < (1 - kMustGainShare) * best.error_px) {
      finding = RestartedFinding(tried->built.problem, first, now, how);
      best = now;
      *solution = *std::move(tried);
      has_base = false;
      resect = true;
    } else {
      if (!initial) {
        has_base = !tried->spanning_tree.empty();
        misleading_pair = has_base ? WorstPair(*tried) : std::nullopt;
      }
      tried = absl::UnknownError("not taken");
      TakeBack(rig, solve, solution);
    }
  }
  return finding;
}

}  // namespace rigcal::server

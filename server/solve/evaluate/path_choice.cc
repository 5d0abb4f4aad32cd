// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/path_choice.h"

#include <Eigen/LU>
#include <algorithm>

#include "common/status/status_macros.h"
#include "server/solve/bundle/bundle_path.h"
#include "server/solve/rig/put_away.h"
#include "server/solve/rig/stamp_jitter.h"

namespace rigcal::server {
namespace {

// What instants leave of the rows' information that a path is tried below, and the share of rows
// alone that it is tried up to.
constexpr double kWorthATrial = 0.85, kMaxAlone = 1.0 / 3;
constexpr size_t kMaxPathCameras = 32, kMaxPathMarkers = 20'000, kMaxPathPoints = 60'000;
constexpr int kMinPathBlocks = 4;
constexpr double kPathSigmas = 1;  // of chance

}  // namespace

bool TriesPath(const RigObservations& rig, const RigSolveOptions& options,
               const RigSolution& solution, TrajectoryChoice choice) {
  if (choice != TrajectoryChoice::kAuto) return choice == TrajectoryChoice::kSpline;
  const BundleProblem& problem = solution.built.problem;
  if (std::ranges::any_of(rig.tracks, &AlignedTrack::is_static)) return false;
  if (NeedsGeneralPath(problem) || problem.cameras.size() > kMaxPathCameras ||
      problem.markers.size() > (problem.IsPoint() ? kMaxPathPoints : kMaxPathMarkers)) {
    return false;
  }
  // Every row is compared with the path at its own time.
  const std::vector<StampJitter> jitter = MeasureStampJitter(problem);
  if (std::ranges::any_of(jitter, &StampJitter::StandsOut)) return false;
  const auto information = [&](int track, int row, size_t column) {
    if (options.sigma_px > 0) return 2 / (options.sigma_px * options.sigma_px);
    return rig.tracks[static_cast<size_t>(track)]
        .track.observations.covariance_px2(static_cast<size_t>(row), column)
        .inverse()
        .trace();
  };
  double interpolated = 0, measured = 0, shared = 0, alone = 0, skipped = 0;
  for (const BundleInstant& instant : problem.instants) {
    ForEachUsedMarker(problem, instant, [&](const BundleObservation&, const BundleMarker& marker) {
      const MarkerSource& source = solution.built.sources[problem.IndexOf(marker)];
      const ImageMotion& motion = solution.motions[static_cast<size_t>(source.track)];
      const size_t count =
          rig.tracks[static_cast<size_t>(source.track)].track.observations.MarkerCount(
              static_cast<size_t>(source.observation));
      const auto label = static_cast<size_t>(marker.marker);
      interpolated += marker.sqrt_information.squaredNorm();
      measured += information(source.track, source.observation,
                              motion.IsFlipped(source.observation) ? count - 1 - label : label);
    });
    shared += instant.used ? static_cast<double>(instant.observation_count) : 0;
  }
  for (const uint32_t count : solution.instants.alone_count) alone += count;
  for (const uint32_t count : solution.instants.skipped_count) skipped += count;
  const double rows = shared + alone + skipped;
  if (!(rows > 0) || !(measured > 0)) return false;
  return interpolated / measured * shared / rows < kWorthATrial && alone / rows < kMaxAlone;
}

bool KeepsPath(const HeldOutGain& gain, TrajectoryChoice choice) {
  if (choice == TrajectoryChoice::kSpline) return true;
  return gain.blocks >= kMinPathBlocks &&
         gain.after_px < gain.before_px + kPathSigmas * gain.sigma_px &&
         gain.rank_sigmas > -kPathSigmas;
}

absl::StatusOr<PathFold> FollowInFold(const RigObservations& rig, const RigSolveOptions& options,
                                      const TimeBlocks& blocks, int fold, int block_count,
                                      const TrajectoryFit* like, RigSolution* by_instants) {
  TakeBack(rig, options, by_instants);
  PathFold result;
  RIGCAL_ASSIGN_OR_RETURN(result.solution, SolveOnTrajectory(rig, options, *by_instants, like));
  RigSolveOptions evaluate = options;
  evaluate.max_observations = 0;
  const auto part_of = [&blocks, fold](int64_t t) {
    return blocks.IsHeldOut(t, fold) ? static_cast<int>(blocks.Block(t)) : -1;
  };
  result.before = EvaluateParts(rig, *by_instants, evaluate, block_count, part_of);
  result.after = EvaluateParts(rig, result.solution, evaluate, block_count, part_of);
  return result;
}

}  // namespace rigcal::server

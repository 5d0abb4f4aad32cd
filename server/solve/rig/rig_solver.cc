// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/rig_solver.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <tuple>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/status/status_macros.h"
#include "server/solve/bundle/bundle_path.h"
#include "server/solve/bundle/marker_residual_px.h"
#include "server/solve/initialize/initialization.h"
#include "server/solve/initialize/shared_views.h"
#include "server/solve/rig/held_clocks.h"
#include "server/solve/rig/held_rig.h"
#include "server/solve/rig/image_motion.h"
#include "server/solve/rig/intrinsics_prior.h"
#include "server/solve/rig/labels.h"
#include "server/solve/rig/line_delay_limit.h"
#include "server/solve/rig/outliers.h"
#include "server/solve/rig/sphere_centres.h"
#include "server/solve/rig/thin_out.h"

namespace rigcal::server {
namespace {

constexpr double kWeakOffsetSigmaS = 1;
constexpr double kWeakRateSigma = 2e-4;  // quartz is within 100 ppm
constexpr double kWeakLineDelaySigmaS = 1e-4;
constexpr double kOutlierPx = 15;
constexpr int kMaxRounds = 8;         // of solve, classify, interpolate again
constexpr int kMaxRoundsOfMany = 20;  // where there are many clocks
// Offsets that move less have settled, or that move their cameras' markers by less, which is a
// small part of what hundreds of markers tell.
constexpr double kTimeToleranceS = 2e-6;
constexpr double kTolerancePx = 5e-4;
constexpr double kFunctionTolerance = 1e-9;  // relative change of the cost
// Relative change of the cost that ends an adjustment whose result is only a stage; and below how
// many times the tolerance in time the clocks must have moved for the next one to be exact.
constexpr double kCoarseTolerance = 1e-5;
constexpr double kExactBelow = 10;
constexpr int kMaxFlips = 2;  // there and back
// Of rough solves: so far a marker is moved along its image velocity well enough; one of so many
// markers may still change between inlier and outlier.
constexpr double kRoughTolerancePx = 0.1;
constexpr size_t kRoughChanges = 500;
constexpr int kMaxRoughRounds = 4;
// Radius of the trust region where values begin that an adjustment has left.
constexpr double kWarmRadius = 1e9;

// The steps of SolveRig with what they share.
class RigSolver {
 public:
  RigSolver(const RigObservations& rig, const std::vector<ClockCorrection>& clocks,
            const RigSolveOptions& options)
      : rig_(rig),
        options_(options),
        longest_line_delay_s_(LongestLineDelays(rig)),
        held_clocks_(rig.tracks, rig.index, clocks, options.reference_camera) {
    solution_.clocks = clocks;
    solution_.motions = options.motions != nullptr ? *options.motions : MotionsOf(rig);
    for (const AlignedTrack& track : rig_.tracks) {
      flip_counts_.emplace_back(track.track.observations.size(), uint8_t{0});
    }
  }

  absl::StatusOr<RigSolution> Run(const RigInitialization* initial) {
    if (initial != nullptr) solution_.clocks = initial->clocks;
    SetLineDelays(initial != nullptr ? initial->line_delay_s : std::vector<double>());
    Build();
    if (problem().instants.empty()) return NoInstants();
    if (initial != nullptr) {
      Adopt(*initial);
      // So that only instants without a pose are placed.
      if (options_.rough) ClassifyOutliers(&problem());
      PlaceInstants(kAgreePx, &problem());
    } else {
      RIGCAL_RETURN_IF_ERROR(
          FindInitialization(InitializationOptionsOf(), &problem(), &solution_.spanning_tree));
      if (options_.held != nullptr) MoveToHeld(*options_.held, &problem());
    }
    // By the rough distances of the initialization.
    bool rough_centres = CorrectCentres() > 0;
    if (FlipWrongLabels() > 0) Rebuild();
    bool labels_at_rest = false, done = false;
    const bool may_hold_others =
        !options_.rough && options_.estimate_time_offsets && HasManyClocks(solution_.clocks);
    const int max_rounds = options_.rough    ? kMaxRoughRounds
                           : may_hold_others ? kMaxRoundsOfMany
                                             : kMaxRounds;
    const int max_changed =
        options_.rough ? static_cast<int>(problem().markers.size() / kRoughChanges) : 0;
    const double tolerance_px = options_.rough ? kRoughTolerancePx : kTolerancePx;
    for (int round = 0; round < max_rounds; ++round) {
      const bool is_last = round + 1 == max_rounds;
      RIGCAL_RETURN_IF_ERROR(Adjust(round, exact_));
      const int flipped = is_last || labels_at_rest ? 0 : FlipWrongLabels();
      const int changed = ClassifyOutliers(&problem());
      if (held_clocks_.HoldsOthers()) held_clocks_.LetFollow(&problem());
      const ClockMovement moved = FindClockMovement(problem());
      const bool at_rest = done || moved.s < kTimeToleranceS || moved.px < tolerance_px;
      const bool is_next_last = round + 2 == max_rounds;
      const bool ready = flipped == 0 && changed <= max_changed && !rough_centres && at_rest;
      // Not on the way: they may go too far and come back.
      const bool held_delays = (ready || is_next_last) && HoldLongDelays();
      const bool settled = ready && !held_delays;
      done = settled && (exact_ || options_.rough);
      solution_.converged = done && !held_clocks_.HoldsOthers();
      if (solution_.converged || is_last) break;
      const bool near_rest = settled || moved.s < kExactBelow * kTimeToleranceS ||
                             moved.px < kExactBelow * tolerance_px;
      exact_ = !options_.rough && (exact_ || near_rest || is_next_last);
      labels_at_rest = near_rest && flipped == 0;
      const bool other_held =
          held_clocks_.Choose(problem(), may_hold_others && !done && !is_next_last);
      if (flipped > 0 || rough_centres || held_delays || !at_rest || other_held) {
        Rebuild();
        rough_centres = false;
      }
    }
    return std::move(solution_);
  }

  absl::StatusOr<RigSolution> Place(const RigInitialization& initial) {
    solution_.clocks = initial.clocks;
    SetLineDelays(initial.line_delay_s);
    Build();
    if (problem().instants.empty()) return NoInstants();
    Adopt(initial);
    PlaceInstants(kAgreePx, &problem());
    CorrectCentres();
    ClassifyOutliers(&problem());
    const std::vector<BundleCamera> cameras = problem().cameras;
    const std::vector<BundleClock> clocks = problem().clocks;
    const bool target_fixed = problem().target.fixed;
    for (BundleCamera& camera : problem().cameras) {
      camera.pose_fixed = camera.intrinsics_fixed = camera.line_delay_fixed = true;
    }
    for (BundleClock& clock : problem().clocks) clock.offset_fixed = clock.rate_fixed = true;
    problem().target.fixed = true;
    RIGCAL_RETURN_IF_ERROR(Adjust(0, true));
    problem().cameras = cameras;
    problem().clocks = clocks;
    problem().target.fixed = target_fixed;
    ClassifyOutliers(&problem());
    solution_.converged = true;
    return std::move(solution_);
  }

 private:
  BundleProblem& problem() { return solution_.built.problem; }

  void SetLineDelays(const std::vector<double>& line_delay_s) {
    solution_.line_delay_s = line_delay_s;
    solution_.line_delay_s.resize(rig_.index.cameras.size(), 0);
    for (size_t c = 0; c < solution_.line_delay_s.size(); ++c) {
      double& delay_s = solution_.line_delay_s[c];
      delay_s = std::clamp(delay_s, -longest_line_delay_s_[c], longest_line_delay_s_[c]);
    }
    for (size_t t = 0; t < rig_.tracks.size(); ++t) SetLineDelayOfTrack(t);
  }
  // Whether any was held.
  bool HoldLongDelays() {
    if (HoldLongLineDelays(longest_line_delay_s_, solution_.line_delay_s, &problem()) == 0) {
      return false;
    }
    at_limit_.resize(problem().cameras.size(), false);
    for (size_t c = 0; c < options_.estimate_line_delays.size(); ++c) {
      const bool is_held = problem().cameras[c].line_delay_fixed;
      at_limit_[c] = options_.estimate_line_delays[c] && is_held;
    }
    return true;
  }
  void SetLineDelayOfTrack(size_t track) {
    if (rig_.tracks[track].is_static) return;
    const auto camera = static_cast<size_t>(rig_.index.camera_of_track[track]);
    solution_.motions[track].SetLineDelay(solution_.line_delay_s[camera]);
  }

  void Build() {
    const auto times = RigTimes(rig_.tracks, rig_.index, solution_.clocks, &solution_.motions);
    solution_.instants = FindInstants(rig_.tracks, times, options_.tolerance_s);
    if (options_.keep_instant) {
      std::erase_if(solution_.instants.instants, [this](const Instant& instant) {
        return !options_.keep_instant(instant.rig_time_ns);
      });
    }
    ThinOut(rig_.index, options_.max_observations, &solution_.instants.instants);
    solution_.built =
        BuildProblem(rig_.Parts(), rig_.tracks, solution_.motions, rig_.index, solution_.clocks,
                     solution_.instants.instants, options_.sigma_px);
    FreeParameters();
  }

  void FreeParameters() {
    problem().cameras[static_cast<size_t>(options_.reference_camera)].pose_fixed = true;
    for (size_t c = 0; options_.held != nullptr && c < problem().cameras.size(); ++c) {
      if (!options_.held->Holds(c)) continue;
      problem().cameras[c].pose_fixed = true;
      problem().cameras[c].cam_from_rig = *options_.held->cam_from_rig[c];
    }
    problem().target.fixed = !options_.estimate_marker_positions;
    problem().rigid_target.fixed = !options_.estimate_marker_positions;
    problem().distance = options_.known_distance;
    for (size_t c = 0; c < problem().cameras.size(); ++c) {
      const bool is_new = c < options_.new_lens.size() && options_.new_lens[c];
      if (!options_.refine_intrinsics && !is_new) continue;
      if (c < options_.keep_intrinsics.size() && options_.keep_intrinsics[c]) continue;
      SetIntrinsicsPrior(rig_.index.cameras[c], &problem().cameras[c],
                         is_new ? kWideIntrinsicsPrior : IntrinsicsPrior());
    }
    for (size_t c = 0; c < options_.estimate_line_delays.size(); ++c) {
      BundleCamera& camera = problem().cameras[c];
      camera.line_delay_fixed =
          !options_.estimate_line_delays[c] || (c < at_limit_.size() && at_limit_[c]);
      camera.prior_line_delay_s = -solution_.line_delay_s[c];
      camera.line_delay_sigma_s = kWeakLineDelaySigmaS;
    }
    for (size_t k = 0; k < problem().clocks.size(); ++k) {
      BundleClock& clock = problem().clocks[k];
      const bool is_reference = held_clocks_.IsReference(k);
      clock.offset_fixed = held_clocks_.IsHeld(k) || !options_.estimate_time_offsets;
      clock.rate_fixed = !options_.estimate_time_rates ||
                         (options_.own_rates.empty() ? is_reference : !options_.own_rates[k]);
      clock.prior_offset_s = -solution_.clocks[k].time_offset_s;
      clock.offset_sigma_s = kWeakOffsetSigmaS;
      clock.prior_rate = -solution_.clocks[k].time_rate;
      clock.rate_sigma = kWeakRateSigma;
    }
  }

  // After each Build, whose centres are as they were observed, once its instants are placed.
  // Returns how many moved.
  int CorrectCentres() {
    return CorrectSphereCentres(rig_.Parts(), rig_.tracks, solution_.motions,
                                IsMetric(rig_, options_), &solution_.built);
  }

  absl::Status NoInstants() const {
    return absl::FailedPreconditionError(absl::StrCat(
        "no instant at which two cameras saw the wand: ", rig_.tracks.size(),
        " camera tracks share no time within the tolerance",
        DescribeNearestViews(rig_.tracks, RigTimes(rig_.tracks, rig_.index, solution_.clocks)),
        "; check that the cameras ran at the same time, and their clocks. Clocks that do not "
        "follow "
        "one time base are related by clock samples, or by a wand with a light code that each "
        "camera sees for 10 s, at 20 frames a second or more, with spheres that are not white",
        CamerasWithoutCode()));
  }

  // Beside others that have read a wand's light code.
  std::string CamerasWithoutCode() const {
    std::set<std::string> without;
    bool any = false;
    for (const AlignedTrack& track : rig_.tracks) {
      if (track.wand == 0) without.insert(track.track.camera.camera);
      any |= track.wand != 0;
    }
    if (!any || without.empty()) return "";
    return absl::StrCat("; others have read such a code, and not ", absl::StrJoin(without, ", "));
  }

  InitializationOptions InitializationOptionsOf() const {
    InitializationOptions initial;
    initial.seed = options_.seed;
    initial.avoided_pairs = options_.avoided_pairs;
    initial.camera_notes = options_.camera_notes;
    initial.cancelled = options_.cancelled;
    if (options_.progress) {
      initial.progress = [this](double fraction) {
        options_.progress(CalibrationStage::kInitializing, fraction);
      };
    }
    return initial;
  }

  void Adopt(const RigInitialization& initial) {
    for (size_t c = 0; c < problem().cameras.size(); ++c) {
      // A held camera is where it is known to be, whatever an initialization has done to it.
      if (options_.held == nullptr || !options_.held->Holds(c)) {
        problem().cameras[c].cam_from_rig = initial.cameras[c].cam_from_rig;
      }
      problem().cameras[c].intrinsics = initial.cameras[c].intrinsics;
    }
    problem().target.marker_positions_m = initial.marker_positions_m;
    if (!initial.points_m.empty()) problem().rigid_target.points_m = initial.points_m;
    problem().distance = initial.distance;
    for (size_t i = 0; i < problem().instants.size(); ++i) {
      BundleInstant& instant = problem().instants[i];
      const InstantMember& first = solution_.instants.instants[i].members.front();
      const auto known = initial.instants.find({first.track, first.observation});
      instant.used = known != initial.instants.end();
      if (!instant.used) continue;
      instant.origin_m = known->second.origin_m;
      instant.direction = known->second.direction;
      instant.rotation = known->second.rotation;
    }
  }

  // Not `exact`: only so far that what follows, outliers and clocks, can be seen.
  absl::Status Adjust(int round, bool exact) {
    BundleOptions bundle;
    if (options_.rough || round > 0) bundle.initial_radius = kWarmRadius;
    bundle.function_tolerance = exact ? kFunctionTolerance : kCoarseTolerance;
    bundle.cancelled = options_.cancelled;
    if (options_.progress) {
      bundle.progress = [this, round](int iteration, double) {
        const double within = iteration / (iteration + 10.0);
        options_.progress(CalibrationStage::kAdjusting, (round + within) / (round + 2.0));
      };
    }
    const absl::StatusOr<BundleSummary> summary = AdjustBundle(bundle, &problem());
    if (absl::IsFailedPrecondition(summary.status())) {
      const std::string lost = DescribeLostCameras(problem(), 1);
      return absl::FailedPreconditionError(
          absl::StrCat(std::string(summary.status().message()), lost.empty() ? "" : ". ", lost));
    }
    RIGCAL_RETURN_IF_ERROR(summary.status());
    solution_.iterations += summary->iterations;
    return absl::OkStatus();
  }

  // Keeps outlying centres out of their neighbours' image motion. Those that are a few pixels off
  // say more about the motion than their absence would.
  void ExcludeFromMotion() {
    const TargetParts parts = rig_.Parts();
    for (const BundleInstant& instant : problem().instants) {
      if (!instant.used) continue;
      for (const BundleObservation& observation : problem().ObservationsOf(instant)) {
        for (const BundleMarker& marker : problem().MarkersOf(observation)) {
          const auto residual = MarkerResidualPx(problem(), instant, observation, marker);
          if (residual && residual->norm() < kOutlierPx) continue;
          const MarkerSource& source = solution_.built.sources[problem().IndexOf(marker)];
          const auto t = static_cast<size_t>(source.track);
          const TargetParts::Part& part = parts.Of(rig_.tracks[t].track.session_id);
          solution_.motions[t].Exclude(source.observation, marker.marker - part.first_marker);
        }
      }
    }
  }

  // Flips labels in the problem and in the image motion that the next one is built with.
  // Returns the number of observations.
  int FlipWrongLabels() {
    std::set<int> touched;
    int count = 0;
    for (const int index : FindFlippedLabels(problem(), solution_.built.instant_time_ns)) {
      const BundleObservation& observation = problem().observations[static_cast<size_t>(index)];
      const MarkerSource& source =
          solution_.built.sources[static_cast<size_t>(observation.first_marker)];
      uint8_t& flips =
          flip_counts_[static_cast<size_t>(source.track)][static_cast<size_t>(source.observation)];
      if (flips == kMaxFlips) continue;
      ++flips;
      ++count;
      touched.insert(source.track);
      FlipLabels(index, &problem());
    }
    for (const int t : touched) {
      std::vector<bool> flipped;
      for (const uint8_t flips : flip_counts_[static_cast<size_t>(t)]) {
        flipped.push_back(flips % 2 == 1);
      }
      solution_.motions[static_cast<size_t>(t)] =
          ImageMotion(rig_.tracks[static_cast<size_t>(t)],
                      rig_.TargetOf(static_cast<size_t>(t)).marker_count(), std::move(flipped));
      SetLineDelayOfTrack(static_cast<size_t>(t));
    }
    return count;
  }

  void Rebuild() {
    ExcludeFromMotion();
    const auto key = [this](size_t m) {
      const MarkerSource& source = solution_.built.sources[m];
      return std::tuple(source.track, source.observation, problem().markers[m].marker);
    };
    std::vector<std::tuple<int, int, int>> outliers;  // track, observation, marker
    for (size_t m = 0; m < problem().markers.size(); ++m) {
      if (!problem().markers[m].used) outliers.push_back(key(m));
    }
    std::ranges::sort(outliers);
    {
      RigInitialization initial = InitializationFrom(solution_);
      held_clocks_.KeepReferences(solution_.clocks, &initial.clocks);
      solution_.clocks = initial.clocks;
      SetLineDelays(initial.line_delay_s);
      // Before the next one is built, so that there is never room for two.
      solution_.built = BuiltProblem();
      Build();
      Adopt(initial);
    }
    for (size_t m = 0; m < problem().markers.size(); ++m) {
      problem().markers[m].used = !std::ranges::binary_search(outliers, key(m));
    }
    PlaceInstants(kAgreePx, &problem());
    CorrectCentres();
  }

  const RigObservations& rig_;
  const RigSolveOptions& options_;
  RigSolution solution_;
  std::vector<std::vector<uint8_t>> flip_counts_;  // by track and observation
  bool exact_ = false;                             // the next adjustment
  std::vector<double> longest_line_delay_s_;       // by camera
  std::vector<bool> at_limit_;                     // by camera: held there
  HeldClocks held_clocks_;
};

}  // namespace

absl::StatusOr<RigSolution> SolveRig(const RigObservations& rig,
                                     const std::vector<ClockCorrection>& clocks,
                                     const RigSolveOptions& options,
                                     const RigInitialization* initial) {
  return RigSolver(rig, clocks, options).Run(initial);
}

absl::StatusOr<RigSolution> PlaceRig(const RigObservations& rig, const RigSolveOptions& options,
                                     const RigInitialization& initial,
                                     const RigSolution& solution) {
  RigSolveOptions place = options;
  place.motions = &solution.motions;
  return RigSolver(rig, initial.clocks, place).Place(initial);
}

}  // namespace rigcal::server

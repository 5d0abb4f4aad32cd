// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "common/calibration/calibration_stage.h"
#include "common/target/target.h"
#include "server/associate/align_clocks.h"
#include "server/associate/instants.h"
#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/rig/problem_builder.h"
#include "server/solve/rig/target_parts.h"

namespace rigcal::server {

struct HeldRig;
struct TrajectoryFit;

// What is solved: cameras, clocks and their rows.
struct RigObservations {
  Target target;                                // of the sessions that other_targets does not name
  std::map<std::string, Target> other_targets;  // by session
  std::vector<AlignedTrack> tracks;
  RigIndex index;

  const Target& TargetOf(const std::string& session_id) const {
    const auto found = other_targets.find(session_id);
    return found == other_targets.end() ? target : found->second;
  }
  const Target& TargetOf(size_t track) const { return TargetOf(tracks[track].track.session_id); }
  TargetParts Parts() const { return {target, other_targets}; }
};

struct RigSolveOptions {
  int reference_camera = 0;  // into the index; its pose is the rig frame
  bool estimate_time_offsets = true;
  // Of every clock but one of each session (the reference camera's); or of those of `own_rates`, by
  // clock, alone: at least one of each session is not.
  bool estimate_time_rates = false;
  std::vector<bool> own_rates;
  // By camera: its line delay (rolling shutter) is estimated. Empty: none is.
  std::vector<bool> estimate_line_delays;
  bool refine_intrinsics = false;
  // By camera of the index, or empty: the model of its lens was found by the data, so that nothing
  // but them says its intrinsics, which are refined in any case.
  std::vector<bool> new_lens;
  // By camera of the index, or empty: its intrinsics are kept while those of others are refined.
  std::vector<bool> keep_intrinsics;
  // Cameras whose poses are held where they are known to be (held_rig.h), which gives the rig frame
  // and the scale; the reference camera is one of them. Null: none but the reference camera.
  std::shared_ptr<const HeldRig> held;
  bool estimate_marker_positions = false;
  // Between two cameras of the index, in metres: the scale of a target of one marker. None: its
  // unit is the distance from the reference camera to the camera initialized farthest from it.
  std::optional<BundleDistance> known_distance;
  double known_distance_sigma_m = 0;  // of the measurement
  double sigma_px = 0;                // instead of the observed covariances; 0 = as observed
  double tolerance_s = 0;             // of an instant; 0 = from the periods
  uint32_t seed = 0;
  std::vector<std::pair<int, int>> avoided_pairs;         // of cameras, see initialization.h
  std::vector<std::string> camera_notes;                  // for error messages
  std::function<bool(int64_t rig_time_ns)> keep_instant;  // none: all
  // Solves on about so many observations of those that are kept; 0: on all (thin_out.h).
  size_t max_observations = 0;
  // For solves that are compared, not published: begins at initial values that are good enough to
  // know outliers by, and ends where what is left to gain would not change an error in pixels.
  bool rough = false;
  // Of the tracks as they are observed, where several solves share them (MotionsOf); null: made.
  const std::vector<ImageMotion>* motions = nullptr;
  std::function<void(CalibrationStage stage, double fraction)> progress;
  const std::atomic<bool>* cancelled = nullptr;
};

struct RigSolution {
  BuiltProblem built;                   // solved; markers not used are the outliers
  std::vector<ClockCorrection> clocks;  // what `built` was interpolated with
  std::vector<double> line_delay_s;     // by camera, likewise
  std::vector<ImageMotion> motions;     // by track, outlying centres excluded, labels flipped
  InstantList instants;
  std::vector<std::pair<int, int>>
      spanning_tree;  // of cameras; empty where an initialization was given
  int iterations = 0;
  bool converged = false;
  // Where the target was followed through time (trajectory_fit.h): cameras, clocks and target are
  // those of its optimum, and `built` is only placed by them. Null: `built` was solved.
  std::shared_ptr<const TrajectoryFit> trajectory;

  // What `built` cannot be made again from, while it is put away.
  struct PutAway {
    std::vector<bool> used;                   // by marker
    std::vector<Eigen::Vector2d> centres_px;  // by marker; empty where they are as observed
  };
  std::optional<PutAway> put_away;
};

// By track, outlying centres excluded.
std::vector<ImageMotion> MotionsOf(const RigObservations& rig);

// Most of a solution's memory are the rows moved to their instants, which the observations give at
// any time: PutAway frees them while something else is solved, TakeBack makes them again, bit for
// bit. In between only cameras, clocks, target and the instants' poses may be looked at. Neither
// does anything to a solution that is in that state.
void PutAway(const RigObservations& rig, const RigSolveOptions& options, RigSolution* solution);
void TakeBack(const RigObservations& rig, const RigSolveOptions& options, RigSolution* solution);

// The unit of length of the solution is the metre, not the distance of two cameras.
bool IsMetric(const RigObservations& rig, const RigSolveOptions& options);

// The labels of this observation were given counted from the target's other end.
bool IsFlipped(const RigSolution& solution, const BundleObservation& observation);

// The target's pose, as of BundleInstant.
struct TargetPose {
  Eigen::Vector3d origin_m, direction;
  BundleInstant::Quaternion rotation;
};
// At an instant, known by its first member.
using InstantPoses = std::map<std::pair<int, int>, TargetPose>;

// Initial values of a solve.
struct RigInitialization {
  std::vector<BundleCamera> cameras;  // poses and intrinsics
  std::vector<double> marker_positions_m;
  std::vector<Eigen::Vector3d> points_m;  // of a rigid target; empty: as given
  std::optional<BundleDistance> distance;
  std::vector<ClockCorrection> clocks;
  std::vector<double> line_delay_s;  // by camera; empty: none
  InstantPoses instants;             // those not named are placed anew
};

RigInitialization InitializationFrom(const RigSolution& solution);

// Associates, initializes unless given initial values, and alternates bundle adjustment, flipping
// of labels, classification of outliers, and interpolation at the new clock corrections until
// nothing moves. Flipped observations are found anew in each solve. In each session the clock of
// the reference camera (or else the first) keeps its correction: time has no origin. (Of many
// clocks another one is held on the way, see HoldsOthers.)
//
// FAILED_PRECONDITION: no instants, not connected, cannot be placed. CANCELLED.
absl::StatusOr<RigSolution> SolveRig(const RigObservations& rig,
                                     const std::vector<ClockCorrection>& clocks,
                                     const RigSolveOptions& options,
                                     const RigInitialization* initial = nullptr);

// Associates by the clocks of `initial` and places the target in the instants with cameras, clocks
// and target held as they are there; labels are flipped as in `solution`. Errors as of SolveRig.
absl::StatusOr<RigSolution> PlaceRig(const RigObservations& rig, const RigSolveOptions& options,
                                     const RigInitialization& initial, const RigSolution& solution);

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "common/geometry/rigid_transform.h"
#include "server/solve/evaluate/kept_lenses.h"
#include "server/solve/evaluate/uncertainty.h"
#include "server/solve/rig/rig_observations.h"
#include "server/solve/rig/rig_solution.h"

namespace rigcal::server {

// Where a solve that left out some of the data put the cameras.
struct FoldPoses {
  std::vector<RigidTransform> cam_from_rig;
  std::vector<bool> intrinsics_fixed;  // by camera
  double left_out = 0;                 // share of the instants in the blocks that were left out
  // By camera: the share of its views that was solved, thinned as they may be.
  std::vector<double> view_shares;
};

// `all`: the solution of all data, which may be put away.
FoldPoses FoldPosesOf(const RigIndex& index, const RigSolution& fold, const RigSolution& all);

// Least data for which the prediction holds.
inline constexpr int kMinPredictedInstants = 60;
inline constexpr int kMinPredictedBlocks = 4;
// And by camera: what its views of a few seconds have in common, no part of the data contradicts.
inline constexpr int kMinCameraBlocks = 3;

// How far the camera positions are expected to be off, and what would be accepted. Lengths are in
// the unit of the solution. One sigma of the camera position known worst, after the best rigid
// motion of the whole rig (FrameFreeCentreCovariance): the frame is that of the reference camera,
// whose own pose may be known ten times worse than the rig's shape. The scale apart, which is as
// good as the wand was measured.
struct PredictedError {
  double sigma_m = 0;      // of all that follows; infinite where something is left undetermined
  double stated_m = 0;     // by the covariance
  double by_lenses_m = 0;  // what intrinsics that were kept add in squares (kept_lenses.h)
  // As large as this, by the covariance, are errors by which parts of the data would differ as
  // these do. At least 1: larger only where chance would not do it in one rig of a thousand.
  double fold_factor = 1;
  double accepted_m = 0;
  double distance_m = 0;  // of the cameras from the middle of the waved volume, median
  int instant_count = 0;
  int block_count = 0;  // blocks of time in which the target was placed a few times
  // The camera whose views are in fewest blocks, any view of it, and how many they are.
  std::string scarcest_camera;
  int scarcest_block_count = 0;
  int fold_count = 0;  // parts of the data that could be solved by themselves
  // False: residuals over so little time say nothing about what they have in common, such as the
  // same part of each image, and no sigma holds.
  bool holds = false;
};

// Two sets of squares: what they are, and what they would be by chance alone.
struct FoldScatter {
  double squares_m2 = 0;
  double expected_m2 = 0;
  // Of the squares, as of a sum of so many independent ones.
  double degrees_of_freedom = 0;

  // The root of their ratio, where it is larger than chance makes it in one of a thousand; else 1.
  double Factor() const;
};

// `accept_m`: CalibrationOptions::accept_m. `lenses`: of the intrinsics that the solution keeps.
//
// The scatter of the folds is compared with what the covariance expects of it: of a fold with the
// share v of the data, (1 - v) / v times the part by independent noise, and l / (1 - l) times the
// rest where the share l of the time was left out (the delete-a-group jackknife, Shao and Wu 1989).
// Folds that refined other lenses than the solution are left out: what lenses do is in `lenses`.
// The degrees of freedom are those of a sum of correlated squares (Satterthwaite, An Approximate
// Distribution of Estimates of Variance Components, Biometrics Bulletin 2, 1946).
PredictedError PredictError(const RigSolution& solution,
                            const std::optional<RigUncertainty>& uncertainty,
                            const KeptLenses& lenses, const std::vector<FoldPoses>& folds,
                            double accept_m);

// The middle of the waved volume: medians of the placed targets' origins, frame rig. Metres.
Eigen::Vector3d MiddleOfWave(const BundleProblem& problem);

// An error by the covariance and the same with what kept lenses add, where parts of the data
// scatter by `fold_factor` more than the covariance says. Lenses are no part of that scatter.
double AllTogether(double by_covariance, double with_lenses, double fold_factor);

// By camera: one sigma of its position as of PredictedError, all together.
std::vector<double> PredictCentreSigmas(const BundleProblem& problem,
                                        const RigUncertainty& uncertainty, const KeptLenses& lenses,
                                        double fold_factor);

}  // namespace rigcal::server

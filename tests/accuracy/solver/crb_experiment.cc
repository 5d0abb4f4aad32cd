// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/solver/crb_experiment.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/status/status_macros.h"
#include "server/associate/static_points.h"
#include "server/solve/calibrate.h"
#include "tests/accuracy/rig/rig_information.h"
#include "tests/accuracy/rig/simulated_tracks.h"
#include "tests/server/solve/simulated_input.h"

namespace rigcal::accuracy {
namespace {

// The bound of sessions whose noise is independent: their information adds up, as the cameras'
// poses are all that they share. Of each world its share of the frames (MixedInputOf).
absl::StatusOr<RigBound> ComputeMixedBound(const std::vector<SimulatedWorld>& worlds,
                                           int reference) {
  RigBound bound;
  for (size_t w = 0; w < worlds.size(); ++w) {
    TrueRig rig = MakeTrueRig(worlds[w], reference);
    const auto count = rig.instants.size();
    const auto at = [&](size_t share) {
      return rig.instants.begin() + static_cast<std::ptrdiff_t>(share * count / worlds.size());
    };
    rig.instants = std::vector<TrueInstant>(at(w), at(w + 1));
    const Target& target = worlds[w].target();
    if (target.IsStatic()) rig = GatherStaticInstants(rig, target.is_surveyed);
    RIGCAL_ASSIGN_OR_RETURN(RigBound own, ComputeRigInformation(rig, {}));
    if (w > 0) own.information += bound.information;
    bound = std::move(own);
  }
  RIGCAL_RETURN_IF_ERROR(FillCovariance(&bound));
  return bound;
}

absl::Status Measure(const std::vector<SimulatedWorld>& worlds, CrbTrial* trial) {
  const SimulatedWorld& world = worlds.front();
  CalibrationOptions options;
  options.intrinsics = options.time_offsets = options.marker_positions = Estimate::kFixed;
  const server::CalibrationOutcome outcome =
      server::Calibrate(server::MixedInputOf(worlds), options);
  RIGCAL_RETURN_IF_ERROR(outcome.result.status());
  const int reference = CameraIndex(world, outcome.result->reference_camera);
  RIGCAL_ASSIGN_OR_RETURN(const RigBound bound, ComputeMixedBound(worlds, reference));

  const auto count = static_cast<Eigen::Index>(3 * (world.cameras().size() - 1));
  Eigen::VectorXd errors(count);
  Eigen::MatrixXd covariance(count, count);
  std::vector<int> index;
  Eigen::Index row = 0;
  for (const CalibratedCamera& camera : outcome.result->cameras) {
    const int c = CameraIndex(world, camera.camera);
    if (c == reference) continue;
    const Eigen::Vector3d error =
        ErrorOf(camera.cam_from_rig, TruePose(world, c, reference)).position_m;
    const double bound_m2 = bound.PositionCovariance(c).trace();
    trial->squared_error_m2 += error.squaredNorm();
    trial->bound_m2 += bound_m2;
    trial->largest_ratio = std::max(trial->largest_ratio, error.norm() / std::sqrt(bound_m2));
    errors.segment<3>(row) = error;
    for (int axis = 0; axis < 3; ++axis) index.push_back(bound.PoseIndex(c) + 3 + axis);
    row += 3;
  }
  if (row != count) return absl::InternalError("a camera is missing in the result");
  for (Eigen::Index i = 0; i < count; ++i) {
    for (Eigen::Index j = 0; j < count; ++j) {
      covariance(i, j) =
          bound.covariance(index[static_cast<size_t>(i)], index[static_cast<size_t>(j)]);
    }
  }
  trial->position_nees = NormalisedErrorSquared(errors, covariance);
  return absl::OkStatus();
}

}  // namespace

Target NamedTarget(const std::string& name) {
  Target target;
  if (name == "wand") {
    target.marker_positions_m = {0, 0.13, 0.39};
    return target;
  }
  if (name == "long") {
    target.marker_positions_m = {0, 0.21, 0.33, 0.6};
    return target;
  }
  target.kind = TargetKind::kRigid;
  const auto add = [&target](double x_m, double y_m, double z_m) {
    target.points.push_back({absl::StrCat("p", target.points.size()), x_m, y_m, z_m, 0});
  };
  if (name == "room" || name == "survey") {
    target.kind = TargetKind::kStatic;
    target.is_surveyed = name == "survey";
    for (int i = 0; i < (target.is_surveyed ? 12 : 40); ++i) {
      const double x_m = target.is_surveyed ? 0.8 * std::sin(2.1 * i) : 0;
      const double y_m = target.is_surveyed ? 0.8 * std::cos(1.3 * i) : 0;
      add(x_m, y_m, target.is_surveyed ? 0.1 * (i - 6) : 0);
    }
    return target;
  }
  if (name == "body") {
    constexpr double kShort = 0.0657, kLong = 0.1063;  // half edges of three golden rectangles
    for (const double a : {-kShort, kShort}) {
      for (const double b : {-kLong, kLong}) {
        add(0, a, b);
        add(a, b, 0);
        add(b, 0, a);
      }
    }
    return target;
  }
  const int step = name == "square" ? 5 : 1;
  for (int row = 0; row < 6; row += step) {
    for (int column = 0; column < 9; column += name == "square" ? 8 : 1) {
      add(0.04 * column, 0.04 * row, 0);
    }
  }
  return target;
}

void SetTargets(const std::string& names, CrbOptions* options) {
  const std::vector<std::string> each = absl::StrSplit(names, '+');
  options->target = NamedTarget(each.front());
  options->mixed_with.clear();
  for (size_t i = 1; i < each.size(); ++i) options->mixed_with.push_back(NamedTarget(each[i]));
}

double CrbTrial::Ratio() const { return std::sqrt(squared_error_m2 / bound_m2); }

CrbTrial RunCrbTrial(const CrbOptions& options, uint32_t seed) {
  SimulationOptions simulation;
  simulation.seed = seed;
  simulation.camera_count = options.camera_count;
  simulation.duration_s = options.duration_s;
  simulation.noise_px = options.noise_px;
  simulation.outlier_share = options.outlier_share;
  simulation.dropout_share = options.dropout_share;
  CrbTrial trial;
  std::vector<Target> targets = options.mixed_with;
  targets.insert(targets.begin(), options.target);
  std::vector<SimulatedWorld> worlds;
  for (const Target& target : targets) {
    SimulationOptions own = simulation;
    // No more rows than a centre stands for, so that the bound is that of all rows.
    if (target.IsStatic()) {
      own.rate_hz =
          server::kMaxRowsOfCentre * static_cast<double>(targets.size()) / options.duration_s;
    }
    absl::StatusOr<SimulatedWorld> world = SimulatedWorld::Create(own, target);
    trial.status = world.status();
    if (!world.ok()) return trial;
    worlds.push_back(*std::move(world));
  }
  trial.status = Measure(worlds, &trial);
  return trial;
}

CrbSummary Summarise(const std::vector<CrbTrial>& trials) {
  CrbSummary summary;
  double error_m2 = 0, bound_m2 = 0;
  for (const CrbTrial& trial : trials) {
    if (!trial.status.ok()) {
      ++summary.failures;
      continue;
    }
    error_m2 += trial.squared_error_m2;
    bound_m2 += trial.bound_m2;
    summary.largest_trial_ratio = std::max(summary.largest_trial_ratio, trial.Ratio());
    summary.largest_camera_ratio = std::max(summary.largest_camera_ratio, trial.largest_ratio);
    summary.position_nees.Add(trial.position_nees);
  }
  summary.ratio = std::sqrt(error_m2 / bound_m2);
  return summary;
}

}  // namespace rigcal::accuracy

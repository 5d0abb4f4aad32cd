// SPDX-License-Identifier: Apache-2.0
// CPU seconds by stage, memory and errors of whole calibrations of large rigs, with the default
// options, findings included: halls of 100, 250 and 500 cameras, of which an instant is seen by
// about twelve (hall_rig.h). Errors are of the cameras' centres after the best alignment by a
// similarity (the wand's length, right here, has a tolerance in the bound), over the Cramer-Rao
// bound of the same; and all of them together, whitened by the bound.
#include <fmt/core.h>
#include <sys/resource.h>
#include <time.h>

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <array>
#include <cmath>
#include <vector>

#include "common/status/status_macros.h"
#include "server/solve/calibrate.h"
#include "tests/accuracy/rig/hall_rig.h"
#include "tests/accuracy/seed_options.h"
#include "tests/accuracy/solver/solver_experiments.h"

namespace rigcal::accuracy {
namespace {

// Of CalibrationStage, in its order.
constexpr std::array kStages = {"",       "read",   "associate", "search", "start",
                                "adjust", "choose", "evaluate",  "report"};
using StageSeconds = std::array<double, kStages.size()>;

double ProcessCpuS() {
  timespec now = {};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double PeakMib() {
  rusage usage = {};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

struct LargeTrial {
  StageSeconds spent_s = {};
  double total_s = 0;
  double peak_mib = 0;
  double error_over_bound = 0;
  double whitened = 0;  // root of NEES / dof
  size_t findings = 0;
};

// A turn, a shift and a growth of all centres, as columns.
Eigen::MatrixXd SimilarMotions(const Eigen::VectorXd& centres_m) {
  Eigen::MatrixXd motions = Eigen::MatrixXd::Zero(centres_m.size(), 7);
  motions.col(6) = centres_m;
  for (Eigen::Index i = 0; i < centres_m.size(); i += 3) {
    const Eigen::Vector3d centre_m = centres_m.segment<3>(i);
    for (int axis = 0; axis < 3; ++axis) {
      motions.block<3, 1>(i, axis) = Eigen::Vector3d::Unit(axis).cross(centre_m);
    }
    motions.block<3, 3>(i, 3).setIdentity();
  }
  return motions;
}

absl::Status CompareWithBound(const CalibrationResult& result, const TrueRig& truth,
                              double span_sigma_m, LargeTrial* trial) {
  RIGCAL_ASSIGN_OR_RETURN(const RigBound bound, ComputeBoundOfParts(truth, span_sigma_m));
  const auto count = static_cast<Eigen::Index>(3 * (truth.cameras.size() - 1));
  Eigen::VectorXd errors(count), centres_m(count);
  std::vector<int> rows;
  for (size_t c = 1; c < truth.cameras.size(); ++c) {
    const auto at = static_cast<Eigen::Index>(3 * (c - 1));
    centres_m.segment<3>(at) = truth.cameras[c].cam_from_rig.SourceFromTargetTranslation();
    errors.segment<3>(at) =
        result.cameras[c].cam_from_rig.SourceFromTargetTranslation() - centres_m.segment<3>(at);
    for (int axis = 0; axis < 3; ++axis) {
      rows.push_back(bound.PoseIndex(static_cast<int>(c)) + 3 + axis);
    }
  }
  const Eigen::MatrixXd covariance = bound.covariance(rows, rows);
  const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
  trial->whitened =
      std::sqrt(errors.dot(factor.solve(errors)) / static_cast<double>(errors.size()));
  // The reference camera's own pose is exact in this frame, and one of many in the alignment.
  const Eigen::HouseholderQR<Eigen::MatrixXd> motions(SimilarMotions(centres_m));
  const Eigen::MatrixXd basis =
      motions.householderQ() * Eigen::MatrixXd::Identity(centres_m.size(), 7);
  const double error_m2 = errors.squaredNorm() - (basis.transpose() * errors).squaredNorm();
  const double bound_m2 = covariance.trace() - (basis.transpose() * covariance * basis).trace();
  trial->error_over_bound = std::sqrt(error_m2 / bound_m2);
  return absl::OkStatus();
}

absl::StatusOr<LargeTrial> RunLargeTrial(const HallOptions& options, double* cameras_per_instant) {
  HallRig hall = MakeHallRig(options);
  *cameras_per_instant = hall.cameras_per_instant;
  const double span_sigma_m = hall.input.target.span_tolerance_m;
  LargeTrial trial;
  CalibrationStage stage = CalibrationStage::kAssociating;
  const double begin_s = ProcessCpuS();
  double since_s = begin_s;
  const auto enter = [&](CalibrationStage next) {
    const double now_s = ProcessCpuS();
    trial.spent_s[static_cast<size_t>(stage)] += now_s - since_s;
    since_s = now_s;
    stage = next;
  };
  server::CalibrationHooks hooks;
  hooks.progress = [&enter](CalibrationStage next, double) { enter(next); };
  const server::CalibrationOutcome outcome =
      server::Calibrate(std::move(hall.input), CalibrationOptions(), hooks);
  enter(stage);
  trial.total_s = ProcessCpuS() - begin_s;
  trial.peak_mib = PeakMib();
  RIGCAL_RETURN_IF_ERROR(outcome.result.status());
  trial.findings = outcome.result->findings.size();
  if (outcome.result->cameras.size() != hall.truth.cameras.size()) {
    return absl::InternalError("a camera is missing in the result");
  }
  RIGCAL_RETURN_IF_ERROR(CompareWithBound(*outcome.result, hall.truth, span_sigma_m, &trial));
  return trial;
}

void PrintGrowth(int from, const LargeTrial& small, int to, const LargeTrial& large) {
  fmt::print("growth {} to {}: n^{:.2f} in all", from, to,
             std::log(large.total_s / small.total_s) / std::log(1.0 * to / from));
  for (size_t s = 2; s < kStages.size(); ++s) {
    fmt::print(", {} {:.2f}", kStages[s],
               std::log(large.spent_s[s] / small.spent_s[s]) / std::log(1.0 * to / from));
  }
  fmt::print("\n");
}

int RunLarge(const SeedOptions& seeds) {
  constexpr int kSmallest = 100;
  fmt::print("cameras  instants  seen by   CPU s");
  for (size_t s = 2; s < kStages.size(); ++s) fmt::print(" {:>9}", kStages[s]);
  fmt::print("   peak MiB  findings  error/bound  whitened\n");
  LargeTrial smallest;
  int failures = 0;
  for (const int cameras : {kSmallest, 250, 500}) {
    if (cameras > seeds.camera_count) continue;
    for (int i = 0; i < seeds.count; ++i) {
      HallOptions options;
      options.camera_count = cameras;
      options.seed = static_cast<uint32_t>(seeds.first + i);
      double cameras_per_instant = 0;
      const absl::StatusOr<LargeTrial> trial = RunLargeTrial(options, &cameras_per_instant);
      if (!trial.ok()) {
        fmt::print("{:7}  FAILED: {}\n", cameras, trial.status().ToString());
        ++failures;
        continue;
      }
      fmt::print("{:7} {:9} {:8.1f} {:7.1f}", cameras, cameras * options.instants_per_camera,
                 cameras_per_instant, trial->total_s);
      for (size_t s = 2; s < kStages.size(); ++s) fmt::print(" {:9.2f}", trial->spent_s[s]);
      fmt::print(" {:10.0f} {:9} {:12.3f} {:9.3f}\n", trial->peak_mib, trial->findings,
                 trial->error_over_bound, trial->whitened);
      std::fflush(stdout);
      if (i > 0) continue;
      if (cameras == kSmallest) {
        smallest = *trial;
      } else {
        PrintGrowth(kSmallest, smallest, cameras, *trial);
      }
    }
  }
  return failures == 0 ? 0 : 1;
}

}  // namespace

Experiment Large() {
  SeedOptions defaults;
  defaults.count = 1;
  defaults.camera_count = 500;
  return SeedExperiment("large", "halls of 100 to 500 cameras: CPU by stage, memory, errors",
                        defaults, RunLarge);
}

}  // namespace rigcal::accuracy

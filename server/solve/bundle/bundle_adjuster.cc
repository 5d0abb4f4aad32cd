// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/bundle_adjuster.h"

#include <ceres/ceres.h>
#include <ceres/normal_prior.h>

#include <algorithm>
#include <exception>
#include <memory>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/solve/bundle/marker_cost.h"
#include "server/solve/bundle/rigid_marker_cost.h"
#include "server/solve/bundle/target_scale.h"

namespace rigcal::server {
namespace {

using LineManifold = ceres::ProductManifold<ceres::EuclideanManifold<3>, ceres::SphereManifold<3>>;
using RigidManifold =
    ceres::ProductManifold<ceres::EigenQuaternionManifold, ceres::EuclideanManifold<3>>;

constexpr size_t kInstantStride = 8;  // 6 values of a line's pose, 7 of a rigid target's

// The problem's estimates as Ceres wants them: one array per parameter block. All of them lie in
// one allocation, in the order of the problem: Ceres orders the blocks of an elimination group by
// their addresses, and two allocations lie in another order in every process, which changes sums.
class ParameterBlocks {
 public:
  explicit ParameterBlocks(const BundleProblem& problem) {
    for (const BundleCamera& camera : problem.cameras) {
      cameras_.push_back(values_.size());
      Append(camera.cam_from_rig.rotation.normalized().coeffs());
      Append(camera.cam_from_rig.translation_m);
      Append(camera.intrinsics);
    }
    line_delays_ = values_.size();
    for (const BundleCamera& camera : problem.cameras) values_.push_back(camera.line_delay_s);
    clocks_ = values_.size();
    for (const BundleClock& clock : problem.clocks) {
      values_.push_back(clock.time_offset_s);
      values_.push_back(clock.time_rate);
    }
    positions_ = values_.size();
    values_.insert(values_.end(), problem.target.marker_positions_m.begin(),
                   problem.target.marker_positions_m.end());
    points_ = values_.size();
    for (const Eigen::Vector3d& point : problem.rigid_target.points_m) Append(point);
    instants_ = values_.size();
    for (const BundleInstant& instant : problem.instants) {
      if (instant.is_rigid) {
        Append(instant.rotation.normalized().coeffs());
        Append(instant.origin_m);
      } else {
        Append(instant.origin_m);
        Append(instant.direction.normalized());
      }
      values_.resize(instants_ + kInstantStride * ++instant_count_);
    }
  }

  double* rotation(size_t camera) { return &values_[cameras_[camera]]; }  // x y z w
  double* translation(size_t camera) { return rotation(camera) + 4; }
  double* intrinsics(size_t camera) { return rotation(camera) + 7; }
  double* line_delay(size_t camera) { return &values_[line_delays_ + camera]; }
  double* offset(size_t clock) { return &values_[clocks_ + 2 * clock]; }
  double* rate(size_t clock) { return offset(clock) + 1; }
  double* position(size_t marker) { return &values_[positions_ + marker]; }
  double* point(size_t marker) { return &values_[points_ + 3 * marker]; }
  double* instant(size_t instant) { return &values_[instants_ + kInstantStride * instant]; }
  // Instants lie behind everything else.
  bool IsInstant(const double* block) const { return block >= values_.data() + instants_; }

  void Store(BundleProblem* problem) {
    for (size_t c = 0; c < problem->cameras.size(); ++c) {
      BundleCamera& camera = problem->cameras[c];
      const Eigen::Quaterniond rotation_read(rotation(c));
      camera.cam_from_rig = {rotation_read.normalized(), Eigen::Vector3d(translation(c))};
      std::copy_n(intrinsics(c), camera.intrinsics.size(), camera.intrinsics.data());
      camera.line_delay_s = *line_delay(c);
    }
    for (size_t k = 0; k < problem->clocks.size(); ++k) {
      problem->clocks[k].time_offset_s = *offset(k);
      problem->clocks[k].time_rate = *rate(k);
    }
    for (size_t m = 0; m < problem->target.marker_positions_m.size(); ++m) {
      problem->target.marker_positions_m[m] = *position(m);
    }
    for (size_t m = 0; m < problem->rigid_target.points_m.size(); ++m) {
      problem->rigid_target.points_m[m] = Eigen::Vector3d(point(m));
    }
    for (size_t i = 0; i < problem->instants.size(); ++i) {
      BundleInstant& to = problem->instants[i];
      if (to.is_rigid) {
        to.rotation = Eigen::Quaterniond(instant(i)).normalized();
        to.origin_m = Eigen::Vector3d(instant(i) + 4);
      } else {
        to.origin_m = Eigen::Vector3d(instant(i));
        to.direction = Eigen::Vector3d(instant(i) + 3).normalized();
      }
    }
  }

 private:
  template <typename Derived>
  void Append(const Eigen::MatrixBase<Derived>& vector) {
    for (Eigen::Index i = 0; i < vector.size(); ++i) values_.push_back(vector[i]);
  }

  std::vector<double> values_;
  std::vector<size_t> cameras_;  // where each camera begins
  size_t line_delays_ = 0, clocks_ = 0, positions_ = 0, points_ = 0, instants_ = 0,
         instant_count_ = 0;
};

class Callback final : public ceres::IterationCallback {
 public:
  explicit Callback(const BundleOptions& options) : options_(options) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override {
    if (options_.progress) options_.progress(summary.iteration, summary.cost);
    const bool stop = options_.cancelled != nullptr && options_.cancelled->load();
    return stop ? ceres::SOLVER_ABORT : ceres::SOLVER_CONTINUE;
  }

 private:
  const BundleOptions& options_;
};

// Adds the markers of all used instants.
void AddMarkers(const BundleProblem& problem, ceres::LossFunction* loss, ParameterBlocks* blocks,
                ceres::Problem* ceres_problem) {
  for (size_t i = 0; i < problem.instants.size(); ++i) {
    ForEachUsedMarker(
        problem, problem.instants[i],
        [&](const BundleObservation& observation, const BundleMarker& marker) {
          const auto c = static_cast<size_t>(observation.camera);
          const auto k = static_cast<size_t>(observation.clock);
          const auto m = static_cast<size_t>(marker.marker);
          if (problem.instants[i].is_rigid) {
            ceres_problem->AddResidualBlock(
                new RigidMarkerCost(problem.cameras[c], marker, observation.clock_time_s), loss,
                blocks->rotation(c), blocks->translation(c), blocks->intrinsics(c),
                blocks->offset(k), blocks->rate(k), blocks->line_delay(c), blocks->point(m),
                blocks->instant(i));
            return;
          }
          ceres_problem->AddResidualBlock(
              new MarkerCost(problem.cameras[c], marker, observation.clock_time_s), loss,
              blocks->rotation(c), blocks->translation(c), blocks->intrinsics(c), blocks->offset(k),
              blocks->rate(k), blocks->line_delay(c), blocks->position(m), blocks->instant(i));
        });
  }
}

void HoldIntrinsics(const BundleCamera& camera, double* values, ceres::Problem* ceres_problem) {
  const int size = static_cast<int>(camera.intrinsics.size());
  std::vector<int> held;
  for (int i = 0; i < size; ++i) {
    if (!(camera.intrinsics_sigma[i] > 0)) held.push_back(i);
  }
  if (static_cast<int>(held.size()) == size) {
    ceres_problem->SetParameterBlockConstant(values);
    return;
  }
  if (!held.empty()) ceres_problem->SetManifold(values, new ceres::SubsetManifold(size, held));
  ceres::Matrix inverse_sigma = ceres::Matrix::Zero(size, size);
  for (int i = 0; i < size; ++i) {
    if (camera.intrinsics_sigma[i] > 0) inverse_sigma(i, i) = 1 / camera.intrinsics_sigma[i];
  }
  ceres_problem->AddResidualBlock(new ceres::NormalPrior(inverse_sigma, camera.intrinsics_mean),
                                  nullptr, values);
}

void ConstrainScalar(bool fixed, double mean, double sigma, double* value,
                     ceres::Problem* ceres_problem) {
  if (!ceres_problem->HasParameterBlock(value)) return;
  if (fixed) {
    ceres_problem->SetParameterBlockConstant(value);
  } else if (sigma > 0) {
    ceres_problem->AddResidualBlock(new ceres::NormalPrior(ceres::Matrix::Constant(1, 1, 1 / sigma),
                                                           ceres::Vector::Constant(1, mean)),
                                    nullptr, value);
  }
}

void ConstrainCameras(const BundleProblem& problem, ParameterBlocks* blocks,
                      ceres::Problem* ceres_problem) {
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    const BundleCamera& camera = problem.cameras[c];
    double* rotation = blocks->rotation(c);
    if (!ceres_problem->HasParameterBlock(rotation)) continue;  // sees nothing
    ceres_problem->SetManifold(rotation, new ceres::EigenQuaternionManifold);
    if (camera.pose_fixed) {
      ceres_problem->SetParameterBlockConstant(rotation);
      ceres_problem->SetParameterBlockConstant(blocks->translation(c));
    }
    // Of a camera that only a distance holds there are none.
    if (!ceres_problem->HasParameterBlock(blocks->intrinsics(c))) continue;
    ConstrainScalar(camera.line_delay_fixed, camera.prior_line_delay_s, camera.line_delay_sigma_s,
                    blocks->line_delay(c), ceres_problem);
    if (camera.intrinsics_fixed) {
      ceres_problem->SetParameterBlockConstant(blocks->intrinsics(c));
    } else {
      HoldIntrinsics(camera, blocks->intrinsics(c), ceres_problem);
    }
  }
}

void ConstrainTarget(const BundleTarget& target, ParameterBlocks* blocks,
                     ceres::Problem* ceres_problem) {
  const size_t count = target.marker_positions_m.size();
  for (size_t m = 0; m < count; ++m) {
    if (!ceres_problem->HasParameterBlock(blocks->position(m))) {
      ceres_problem->AddParameterBlock(blocks->position(m), 1);
    }
    if (target.fixed) ceres_problem->SetParameterBlockConstant(blocks->position(m));
  }
  if (target.fixed || count == 0) return;
  for (const BundleWand& wand : target.Wands()) {
    const auto first = static_cast<size_t>(wand.first), end = static_cast<size_t>(wand.end);
    ceres_problem->SetParameterBlockConstant(blocks->position(first));
    for (size_t m = first + 1; m < end; ++m) {
      const double span_m = target.given_positions_m[m] - target.given_positions_m[m - 1];
      ceres_problem->AddResidualBlock(new ceres::AutoDiffCostFunction<SpanPrior, 1, 1, 1>(
                                          new SpanPrior{span_m, wand.span_sigma_m}),
                                      nullptr, blocks->position(m - 1), blocks->position(m));
    }
  }
}

void ConstrainRigidTarget(const BundleRigidTarget& target, ParameterBlocks* blocks,
                          ceres::Problem* ceres_problem) {
  for (size_t m = 0; m < target.points_m.size(); ++m) {
    double* const point = blocks->point(m);
    if (!ceres_problem->HasParameterBlock(point)) continue;  // seen by no camera
    if (target.IsFree(m)) {
      const ceres::Matrix inverse_sigma = ceres::Matrix::Identity(3, 3) / target.sigma_m[m];
      ceres_problem->AddResidualBlock(
          new ceres::NormalPrior(inverse_sigma, target.given_points_m[m]), nullptr, point);
    } else {
      ceres_problem->SetParameterBlockConstant(point);
    }
  }
}

void ConstrainDistance(const BundleProblem& problem, ParameterBlocks* blocks,
                       ceres::Problem* ceres_problem) {
  if (!problem.distance) return;
  const BundleDistance& distance = *problem.distance;
  const auto a = static_cast<size_t>(distance.camera_a), b = static_cast<size_t>(distance.camera_b);
  ceres_problem->AddResidualBlock(new ceres::AutoDiffCostFunction<DistancePrior, 1, 4, 3, 4, 3>(
                                      new DistancePrior{distance.distance_m, distance.sigma_m}),
                                  nullptr, blocks->rotation(a), blocks->translation(a),
                                  blocks->rotation(b), blocks->translation(b));
}

ceres::Solver::Options SolverOptions(const BundleOptions& options, ParameterBlocks* blocks,
                                     const ceres::Problem& ceres_problem) {
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::DENSE_SCHUR;
  solver.num_threads = 1;
  solver.max_num_iterations = options.max_iterations;
  solver.function_tolerance = options.function_tolerance;
  solver.gradient_tolerance = options.gradient_tolerance;
  solver.initial_trust_region_radius = options.initial_radius;
  solver.parameter_tolerance = options.parameter_tolerance;
  solver.logging_type = ceres::SILENT;
  // The order in which blocks were added decides sums, so it is stated instead of found.
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  std::vector<double*> all;
  ceres_problem.GetParameterBlocks(&all);
  for (double* block : all) ordering->AddElementToGroup(block, blocks->IsInstant(block) ? 0 : 1);
  solver.linear_solver_ordering = std::move(ordering);
  return solver;
}

absl::StatusOr<BundleSummary> Solve(const BundleOptions& options, BundleProblem* problem) {
  ParameterBlocks blocks(*problem);
  std::unique_ptr<ceres::LossFunction> loss;
  if (options.robust) loss = std::make_unique<ceres::CauchyLoss>(options.loss_scale);
  ceres::Problem::Options problem_options;
  problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem ceres_problem(problem_options);
  BundleSummary result;
  AddMarkers(*problem, loss.get(), &blocks, &ceres_problem);
  if (ceres_problem.NumResidualBlocks() == 0) {
    return absl::FailedPreconditionError("bundle adjustment: no marker is used");
  }
  for (size_t i = 0; i < problem->instants.size(); ++i) {
    if (!ceres_problem.HasParameterBlock(blocks.instant(i))) continue;
    ceres::Manifold* manifold = nullptr;
    if (problem->instants[i].is_point) {
      manifold = new ceres::SubsetManifold(7, {0, 1, 2, 3});
    } else if (problem->instants[i].is_rigid) {
      manifold = new RigidManifold;
    } else {
      manifold = new LineManifold;
    }
    ceres_problem.SetManifold(blocks.instant(i), manifold);
  }
  ConstrainDistance(*problem, &blocks, &ceres_problem);
  ConstrainCameras(*problem, &blocks, &ceres_problem);
  for (size_t k = 0; k < problem->clocks.size(); ++k) {
    const BundleClock& clock = problem->clocks[k];
    ConstrainScalar(clock.offset_fixed, clock.prior_offset_s, clock.offset_sigma_s,
                    blocks.offset(k), &ceres_problem);
    ConstrainScalar(clock.rate_fixed, clock.prior_rate, clock.rate_sigma, blocks.rate(k),
                    &ceres_problem);
  }
  ConstrainTarget(problem->target, &blocks, &ceres_problem);
  ConstrainRigidTarget(problem->rigid_target, &blocks, &ceres_problem);

  ceres::Solver::Options solver_options = SolverOptions(options, &blocks, ceres_problem);
  Callback callback(options);
  solver_options.callbacks.push_back(&callback);
  ceres::Solver::Summary summary;
  ceres::Solve(solver_options, &ceres_problem, &summary);
  if (summary.termination_type == ceres::USER_FAILURE) {
    return absl::CancelledError("the calibration was cancelled");
  }
  if (!summary.IsSolutionUsable() || !std::isfinite(summary.final_cost)) {
    return absl::FailedPreconditionError(
        absl::StrCat("bundle adjustment failed: ", summary.message));
  }
  blocks.Store(problem);
  result.initial_cost = summary.initial_cost;
  result.final_cost = summary.final_cost - SettleScale(problem).gain;
  result.iterations = static_cast<int>(summary.iterations.size()) - 1;
  result.converged = summary.termination_type == ceres::CONVERGENCE;
  return result;
}

}  // namespace

absl::StatusOr<BundleSummary> SolveBundle(const BundleOptions& options, BundleProblem* problem) {
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  RIGCAL_RETURN_IF_ERROR(problem->Validate());
  try {
    return Solve(options, problem);
  } catch (const std::exception& error) {
    return absl::InternalError(absl::StrCat("bundle adjustment: ", error.what()));
  }
}

}  // namespace rigcal::server

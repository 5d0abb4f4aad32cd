// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/reference_bundle.h"

#include <ceres/ceres.h>

#include <array>
#include <memory>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "server/solve/bundle/marker_residual_px.h"
#include "tests/bench/reference_costs.h"

namespace rigcal::testing {
namespace {

using server::BundleCamera;
using server::BundleInstant;
using server::BundleMarker;
using server::BundleObservation;
using server::BundleProblem;
using server::ReducedParameter;
using server::ReducedParameterKind;

class Reference {
 public:
  Reference(const server::BundleOptions& options, const BundleProblem& problem)
      : options_(options), problem_(problem), positions_(problem.target.marker_positions_m) {
    for (const BundleCamera& camera : problem.cameras) {
      rotations_.push_back(camera.cam_from_rig.rotation.normalized());
      translations_.push_back(camera.cam_from_rig.translation_m);
      intrinsics_.push_back(camera.intrinsics);
    }
    for (const auto& clock : problem.clocks) {
      offsets_.push_back(clock.time_offset_s);
      rates_.push_back(clock.time_rate);
    }
    for (const BundleInstant& instant : problem.instants) {
      targets_.emplace_back();
      targets_.back() << instant.origin_m, instant.direction.normalized();
    }
    if (options.robust) loss_ = std::make_unique<ceres::CauchyLoss>(options.loss_scale);
    ceres::Problem::Options ownership;
    ownership.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    ceres_ = std::make_unique<ceres::Problem>(ownership);
    AddMarkers();
    ConstrainCameras();
    ConstrainClocks();
    ConstrainTarget();
    for (auto& target : targets_) {
      if (!ceres_->HasParameterBlock(target.data())) continue;
      ceres_->SetManifold(
          target.data(),
          new ceres::ProductManifold<ceres::EuclideanManifold<3>, ceres::SphereManifold<3>>);
    }
  }

  ceres::Solver::Summary Solve() {
    ceres::Solver::Options solver;
    solver.linear_solver_type = ceres::SPARSE_SCHUR;
    solver.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;
    solver.num_threads = 1;
    solver.max_num_iterations = options_.max_iterations;
    solver.function_tolerance = options_.function_tolerance;
    solver.gradient_tolerance = options_.gradient_tolerance;
    solver.parameter_tolerance = options_.parameter_tolerance;
    solver.logging_type = ceres::SILENT;
    auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    std::set<const double*> instants;
    for (const auto& target : targets_) instants.insert(target.data());
    std::vector<double*> blocks;
    ceres_->GetParameterBlocks(&blocks);
    for (double* block : blocks)
      ordering->AddElementToGroup(block, instants.contains(block) ? 0 : 1);
    solver.linear_solver_ordering = std::move(ordering);
    ceres::Solver::Summary summary;
    ceres::Solve(solver, ceres_.get(), &summary);
    return summary;
  }

  void Store(BundleProblem* problem) const {
    for (size_t c = 0; c < rotations_.size(); ++c) {
      problem->cameras[c].cam_from_rig = {rotations_[c].normalized(), translations_[c]};
      problem->cameras[c].intrinsics = intrinsics_[c];
    }
    for (size_t k = 0; k < offsets_.size(); ++k) {
      problem->clocks[k].time_offset_s = offsets_[k];
      problem->clocks[k].time_rate = rates_[k];
    }
    problem->target.marker_positions_m = positions_;
    for (size_t i = 0; i < targets_.size(); ++i) {
      problem->instants[i].origin_m = targets_[i].head<3>();
      problem->instants[i].direction = targets_[i].tail<3>().normalized();
    }
  }

  absl::StatusOr<Eigen::MatrixXd> Covariance(const std::vector<ReducedParameter>& parameters) {
    std::vector<std::pair<const double*, const double*>> pairs;
    std::vector<const double*> blocks;
    for (const ReducedParameter& parameter : parameters) blocks.push_back(Block(parameter));
    std::set<const double*> distinct(blocks.begin(), blocks.end());
    for (const double* a : distinct) {
      for (const double* b : distinct) {
        if (a <= b) pairs.emplace_back(a, b);
      }
    }
    ceres::Covariance covariance{ceres::Covariance::Options()};
    if (!covariance.Compute(pairs, ceres_.get())) {
      return absl::InternalError("the reference covariance cannot be computed");
    }
    const auto n = static_cast<Eigen::Index>(parameters.size());
    Eigen::MatrixXd result(n, n);
    for (size_t i = 0; i < parameters.size(); ++i) {
      for (size_t j = 0; j < parameters.size(); ++j) {
        const int columns = ceres_->ParameterBlockTangentSize(blocks[j]);
        std::vector<double> block(
            static_cast<size_t>(ceres_->ParameterBlockTangentSize(blocks[i]) * columns));
        covariance.GetCovarianceBlockInTangentSpace(blocks[i], blocks[j], block.data());
        const int at = TangentIndex(parameters[i]) * columns + TangentIndex(parameters[j]);
        // Ceres steps a quaternion by half the rotation vector.
        result(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) =
            block[static_cast<size_t>(at)] * Scale(parameters[i]) * Scale(parameters[j]);
      }
    }
    return result;
  }

 private:
  static double Scale(const ReducedParameter& parameter) {
    return parameter.kind == ReducedParameterKind::kRotation ? 2 : 1;
  }

  const double* Block(const ReducedParameter& parameter) const {
    const auto index = static_cast<size_t>(parameter.index);
    switch (parameter.kind) {
      case ReducedParameterKind::kRotation:
        return rotations_[index].coeffs().data();
      case ReducedParameterKind::kTranslation:
        return translations_[index].data();
      case ReducedParameterKind::kIntrinsic:
        return intrinsics_[index].data();
      case ReducedParameterKind::kTimeOffset:
        return &offsets_[index];
      case ReducedParameterKind::kTimeRate:
        return &rates_[index];
      case ReducedParameterKind::kMarkerPosition:
        return &positions_[index];
      case ReducedParameterKind::kLineDelay:    // held
      case ReducedParameterKind::kTargetPoint:  // it has no rigid target
        break;
    }
    return nullptr;
  }

  int TangentIndex(const ReducedParameter& parameter) const {
    if (parameter.kind != ReducedParameterKind::kIntrinsic) return parameter.component;
    const BundleCamera& camera = problem_.cameras[static_cast<size_t>(parameter.index)];
    int index = 0;
    for (int i = 0; i < parameter.component; ++i) index += camera.intrinsics_sigma[i] > 0 ? 1 : 0;
    return index;
  }

  bool IntrinsicsFree(size_t camera) const {
    return !problem_.cameras[camera].intrinsics_fixed &&
           problem_.cameras[camera].intrinsics_sigma.maxCoeff() > 0;
  }

  template <int kIntrinsics>
  void AddFree(const FixedLineDelayCost& residual, size_t c, size_t k, double* position,
               double* target) {
    auto* functor = new FixedLineDelayCost(residual);
    ceres_->AddResidualBlock(
        new ceres::AutoDiffCostFunction<FixedLineDelayCost, 2, 4, 3, kIntrinsics, 1, 1, 1, 6>(
            functor),
        loss_.get(), rotations_[c].coeffs().data(), translations_[c].data(), intrinsics_[c].data(),
        &offsets_[k], &rates_[k], position, target);
  }

  void AddMarker(const FixedLineDelayCost& residual, size_t c, size_t k, double* position,
                 double* target) {
    if (IntrinsicsFree(c)) {
      switch (residual.marker.model) {
        case DistortionModel::kBrownConrady:
          return AddFree<9>(residual, c, k, position, target);
        case DistortionModel::kRational:
          return AddFree<12>(residual, c, k, position, target);
        case DistortionModel::kFisheye:
          return AddFree<8>(residual, c, k, position, target);
      }
    }
    auto* functor = new FixedIntrinsicsCost{residual, {}};
    for (int i = 0; i < intrinsics_[c].size(); ++i) {
      functor->values[static_cast<size_t>(i)] = intrinsics_[c][i];
    }
    ceres_->AddResidualBlock(
        new ceres::AutoDiffCostFunction<FixedIntrinsicsCost, 2, 4, 3, 1, 1, 1, 6>(functor),
        loss_.get(), rotations_[c].coeffs().data(), translations_[c].data(), &offsets_[k],
        &rates_[k], position, target);
  }

  void AddMarkers() {
    for (size_t i = 0; i < problem_.instants.size(); ++i) {
      ForEachUsedMarker(problem_, problem_.instants[i],
                        [&](const BundleObservation& observation, const BundleMarker& marker) {
                          const auto c = static_cast<size_t>(observation.camera);
                          const BundleCamera& camera = problem_.cameras[c];
                          AddMarker({{camera.model, server::ToMeasured(marker),
                                      observation.clock_time_s, camera.middle_row},
                                     camera.line_delay_s},
                                    c, static_cast<size_t>(observation.clock),
                                    &positions_[static_cast<size_t>(marker.marker)],
                                    targets_[i].data());
                        });
    }
  }

  void ConstrainCameras() {
    for (size_t c = 0; c < problem_.cameras.size(); ++c) {
      const BundleCamera& camera = problem_.cameras[c];
      double* rotation = rotations_[c].coeffs().data();
      if (!ceres_->HasParameterBlock(rotation)) continue;
      ceres_->SetManifold(rotation, new ceres::EigenQuaternionManifold);
      if (camera.pose_fixed) {
        ceres_->SetParameterBlockConstant(rotation);
        ceres_->SetParameterBlockConstant(translations_[c].data());
      }
      if (!IntrinsicsFree(c)) continue;
      const int size = static_cast<int>(camera.intrinsics.size());
      std::vector<int> held;
      for (int i = 0; i < size; ++i) {
        if (!(camera.intrinsics_sigma[i] > 0)) {
          held.push_back(i);
          continue;
        }
        AddIntrinsicPrior(size,
                          new ScalarPrior{camera.intrinsics_mean[i], camera.intrinsics_sigma[i], i},
                          intrinsics_[c].data());
      }
      if (!held.empty()) {
        ceres_->SetManifold(intrinsics_[c].data(), new ceres::SubsetManifold(size, held));
      }
    }
  }

  void AddIntrinsicPrior(int size, ScalarPrior* prior, double* values) {
    ceres::CostFunction* cost = nullptr;
    if (size == 9) cost = new ceres::AutoDiffCostFunction<ScalarPrior, 1, 9>(prior);
    if (size == 12) cost = new ceres::AutoDiffCostFunction<ScalarPrior, 1, 12>(prior);
    if (size == 8) cost = new ceres::AutoDiffCostFunction<ScalarPrior, 1, 8>(prior);
    ceres_->AddResidualBlock(cost, nullptr, values);
  }

  void ConstrainScalar(bool fixed, double mean, double sigma, double* value) {
    if (!ceres_->HasParameterBlock(value)) return;
    if (fixed) {
      ceres_->SetParameterBlockConstant(value);
    } else if (sigma > 0) {
      ceres_->AddResidualBlock(
          new ceres::AutoDiffCostFunction<ScalarPrior, 1, 1>(new ScalarPrior{mean, sigma, 0}),
          nullptr, value);
    }
  }

  void ConstrainClocks() {
    for (size_t k = 0; k < problem_.clocks.size(); ++k) {
      const auto& clock = problem_.clocks[k];
      ConstrainScalar(clock.offset_fixed, clock.prior_offset_s, clock.offset_sigma_s, &offsets_[k]);
      ConstrainScalar(clock.rate_fixed, clock.prior_rate, clock.rate_sigma, &rates_[k]);
    }
  }

  void ConstrainTarget() {
    for (double& position : positions_) {
      ceres_->AddParameterBlock(&position, 1);
      if (problem_.target.fixed || &position == &positions_.front()) {
        ceres_->SetParameterBlockConstant(&position);
      }
    }
    if (problem_.target.fixed) return;
    const std::vector<double>& given = problem_.target.given_positions_m;
    for (size_t m = 1; m < positions_.size(); ++m) {
      ceres_->AddResidualBlock(
          new ceres::AutoDiffCostFunction<DifferencePrior, 1, 1, 1>(
              new DifferencePrior{given[m] - given[m - 1], problem_.target.span_sigma_m}),
          nullptr, &positions_[m - 1], &positions_[m]);
    }
  }

  const server::BundleOptions& options_;
  const BundleProblem& problem_;
  std::vector<Eigen::Quaterniond> rotations_;
  std::vector<Eigen::Vector3d> translations_;
  std::vector<IntrinsicsVector> intrinsics_;
  std::vector<double> offsets_, rates_, positions_;
  std::vector<Eigen::Matrix<double, 6, 1>> targets_;
  std::unique_ptr<ceres::LossFunction> loss_;
  std::unique_ptr<ceres::Problem> ceres_;
};

}  // namespace

absl::StatusOr<server::BundleSummary> SolveReferenceBundle(const server::BundleOptions& options,
                                                           BundleProblem* problem,
                                                           double* minimizer_s) {
  Reference reference(options, *problem);
  const ceres::Solver::Summary summary = reference.Solve();
  if (!summary.IsSolutionUsable()) {
    return absl::FailedPreconditionError(absl::StrCat("reference: ", summary.message));
  }
  reference.Store(problem);
  if (minimizer_s != nullptr) *minimizer_s = summary.minimizer_time_in_seconds;
  server::BundleSummary result;
  result.initial_cost = summary.initial_cost;
  result.final_cost = summary.final_cost;
  result.iterations = static_cast<int>(summary.iterations.size()) - 1;
  result.converged = summary.termination_type == ceres::CONVERGENCE;
  return result;
}

absl::StatusOr<Eigen::MatrixXd> ReferenceCovariance(
    const server::BundleOptions& options, const BundleProblem& problem,
    const std::vector<ReducedParameter>& parameters) {
  return Reference(options, problem).Covariance(parameters);
}

}  // namespace rigcal::testing

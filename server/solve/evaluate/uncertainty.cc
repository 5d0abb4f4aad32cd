// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/uncertainty.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "common/status/status_macros.h"
#include "server/solve/bundle/bundle_path.h"
#include "server/solve/bundle/marker_residual_px.h"
#include "server/solve/evaluate/attached_point.h"
#include "server/solve/evaluate/block_scatter.h"
#include "server/solve/evaluate/held_uncertainty.h"
#include "server/solve/rig/trajectory_fit.h"
#include "server/solve/trajectory/trajectory_system.h"

namespace rigcal::server {
namespace {

// Freedom of a rigid target, a line and a point.
constexpr int kRigidParameters = 6, kLineParameters = 5, kPointParameters = 3;
// Two cameras that see one marker each leave no redundancy.
constexpr double kMaxLeverage = 0.8;
// Of rows whose errors may have something in common, as in block_scatter.h.
constexpr int64_t kPathBlockNs = 2'000'000'000;

double InverseSquare(double sigma) { return sigma > 0 ? 1 / (sigma * sigma) : 0; }

// Of the spans between the markers of wands.
void AddSpanPriors(const BundleTarget& target, const std::vector<ReducedParameter>& parameters,
                   Eigen::MatrixXd* prior) {
  const auto row_of = [&parameters](int marker) -> Eigen::Index {
    const ReducedParameter wanted = {ReducedParameterKind::kMarkerPosition, marker, 0};
    const auto found = std::find(parameters.begin(), parameters.end(), wanted);
    return found == parameters.end() ? -1 : found - parameters.begin();
  };
  for (const BundleWand& wand : target.Wands()) {
    Eigen::Index before = row_of(wand.first);
    if (before >= 0) (*prior)(before, before) += InverseSquare(kHeldMarkerSigmaM);
    for (int m = wand.first + 1; m < wand.end; ++m) {
      const Eigen::Index own = row_of(m);
      if (own < 0) return;
      const double weight = InverseSquare(wand.span_sigma_m);
      (*prior)(own, own) += weight;
      if (before >= 0) {
        (*prior)(before, before) += weight;
        (*prior)(own, before) = (*prior)(before, own) = -weight;
      }
      before = own;
    }
  }
}

// The priors' part of the information.
Eigen::MatrixXd PriorInformation(const BundleProblem& problem,
                                 const std::vector<ReducedParameter>& parameters) {
  const auto size = static_cast<Eigen::Index>(parameters.size());
  Eigen::MatrixXd prior = Eigen::MatrixXd::Zero(size, size);
  for (Eigen::Index i = 0; i < size; ++i) {
    const ReducedParameter& parameter = parameters[static_cast<size_t>(i)];
    const auto index = static_cast<size_t>(parameter.index);
    switch (parameter.kind) {
      case ReducedParameterKind::kIntrinsic:
        prior(i, i) = InverseSquare(problem.cameras[index].intrinsics_sigma[parameter.component]);
        break;
      case ReducedParameterKind::kTimeOffset:
        prior(i, i) = InverseSquare(problem.clocks[index].offset_sigma_s);
        break;
      case ReducedParameterKind::kLineDelay:
        prior(i, i) = InverseSquare(problem.cameras[index].line_delay_sigma_s);
        break;
      case ReducedParameterKind::kTimeRate:
        prior(i, i) = InverseSquare(problem.clocks[index].rate_sigma);
        break;
      case ReducedParameterKind::kTargetPoint:
        prior(i, i) = InverseSquare(problem.rigid_target.sigma_m[index]);
        break;
      default:
        break;
    }
  }
  AddSpanPriors(problem.target, parameters, &prior);
  return prior;
}

// |r|^2 of the whitened residuals of an instant's markers that are used.
struct SquaredNorm {
  double value, noise_share;
};
std::vector<SquaredNorm> SquaredNorms(const BuiltProblem& built, const BundleInstant& instant) {
  const BundleProblem& problem = built.problem;
  std::vector<SquaredNorm> squares;
  for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
    for (const BundleMarker& marker : problem.MarkersOf(observation)) {
      const auto residual = MarkerResidualPx(problem, instant, observation, marker);
      if (!marker.used || !residual) continue;
      squares.push_back({(marker.sqrt_information * *residual).squaredNorm(),
                         built.sources[problem.IndexOf(marker)].noise_share});
    }
  }
  return squares;
}

// The factors of uncertainty.h, for the Cauchy loss of the solve.
class LossSum {
 public:
  explicit LossSum(double loss_scale) : c2_(loss_scale * loss_scale) {}

  // Of a whitened residual: its squared norm, the share of its own variance that it has, and its
  // leverage.
  void Add(double raw, double noise_share, double leverage) {
    weight_ += 1 / (1 + raw / c2_);
    const double s = raw / (noise_share * (1 - leverage));
    const double w = 1 / (1 + s / c2_);
    // The derivative of psi has the eigenvalues w, across the residual, and 2 w^2 - w along it.
    slope_ += w * w;
    slope_square_ += w * w * (1 + 2 * w * (w - 1));
    taken_ += leverage;
    square_ += 0.5 * w * w * s;
    count_ += 1;
  }
  double count() const { return count_; }
  // `free`: numbers that have been estimated, of twice as many as there are residuals.
  LossFactors Factors(double free) const {
    if (2 * count_ <= free || !(slope_ > 0)) return {};
    const double spread = slope_square_ * count_ / (slope_ * slope_) - 1;
    const double correction = 1 + taken_ / count_ * spread;
    return {correction * correction * weight_ * square_ / (slope_ * slope_), slope_ / weight_};
  }

 private:
  double c2_;
  double weight_ = 0, slope_ = 0, slope_square_ = 0, square_ = 0, taken_ = 0, count_ = 0;
};

LossFactors MeasureLossFactors(const BuiltProblem& built, double loss_scale, Eigen::Index free) {
  const BundleProblem& problem = built.problem;
  const auto freedom_of = [&problem](const BundleInstant& instant) {
    return instant.is_point || problem.IsPoint() ? kPointParameters
           : instant.is_rigid                    ? kRigidParameters
                                                 : kLineParameters;
  };
  double count = 0, freedom = 0;
  for (const BundleInstant& instant : problem.instants) {
    if (!instant.used) continue;
    freedom += freedom_of(instant);
    count += static_cast<double>(SquaredNorms(built, instant).size());
  }
  const double shared = count > 0 ? static_cast<double>(free) / (2 * count) : 1;
  LossSum sum(loss_scale);
  for (const BundleInstant& instant : problem.instants) {
    if (!instant.used) continue;
    const std::vector<SquaredNorm> squares = SquaredNorms(built, instant);
    const double leverage = std::min(
        kMaxLeverage, shared + 0.5 * freedom_of(instant) /
                                   static_cast<double>(std::max<size_t>(1, squares.size())));
    for (const auto& [raw, noise_share] : squares) sum.Add(raw, noise_share, leverage);
  }
  return sum.Factors(freedom + static_cast<double>(free));
}

// Symmetric inverse by Cholesky of the matrix with a unit diagonal: parameters of very different
// units share it.
absl::StatusOr<Eigen::MatrixXd> Inverse(const Eigen::MatrixXd& information) {
  const Eigen::VectorXd diagonal = information.diagonal();
  if (!(diagonal.minCoeff() > 0)) {
    return absl::InternalError("uncertainty: a parameter is not determined by the data");
  }
  const Eigen::VectorXd scale = diagonal.cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * information * scale.asDiagonal();
  const Eigen::LLT<Eigen::MatrixXd> factor(scaled);
  if (factor.info() != Eigen::Success) {
    return absl::InternalError("uncertainty: the parameters are not determined by the data");
  }
  const Eigen::MatrixXd inverse =
      factor.solve(Eigen::MatrixXd::Identity(scaled.rows(), scaled.cols()));
  if (!inverse.allFinite()) return absl::InternalError("uncertainty: not finite");
  return Eigen::MatrixXd(scale.asDiagonal() * inverse * scale.asDiagonal());
}

// Takes the scatter of the blocks for what their errors have in common; uncertainty.h says how.
void AllowForCommonErrors(const BlockScatter& scatter, const Eigen::MatrixXd& prior,
                          RigUncertainty* rig) {
  rig->design_effect = scatter.design_effect;
  rig->noise_covariance = rig->covariance;
  if (scatter.block_count() == 0 || !(scatter.design_effect > 1)) return;
  const double kept = 1 / std::sqrt(scatter.design_effect);
  const Eigen::MatrixXd by_blocks =
      scatter.changes * scatter.changes.transpose() + rig->covariance * prior * rig->covariance;
  rig->covariance = kept * rig->covariance + (1 - kept) * by_blocks;
}

// Rows of the uncertainty, -1 for none, in the packed order.
std::vector<Eigen::Index> RowsOf(const BundleProblem& problem, int reference_camera,
                                 const RigUncertainty& uncertainty) {
  std::vector<Eigen::Index> rows;
  const auto add = [&](ReducedParameterKind kind, int camera, int component) {
    rows.push_back(uncertainty.Row({kind, camera, component}));
  };
  for (int c = 0; c < static_cast<int>(problem.cameras.size()); ++c) {
    const BundleCamera& camera = problem.cameras[static_cast<size_t>(c)];
    if (c != reference_camera) {
      for (int i = 0; i < 3; ++i) add(ReducedParameterKind::kRotation, c, i);
      for (int i = 0; i < 3; ++i) add(ReducedParameterKind::kTranslation, c, i);
    }
    if (camera.intrinsics_fixed) continue;
    for (int i = 0; i < static_cast<int>(camera.intrinsics.size()); ++i) {
      add(ReducedParameterKind::kIntrinsic, c, i);
    }
  }
  return rows;
}

CameraUncertainty OfCamera(const BundleProblem& problem, int index, const RigUncertainty& rig) {
  const BundleCamera& camera = problem.cameras[static_cast<size_t>(index)];
  CameraUncertainty result;
  const Eigen::Index rotation = rig.Row({ReducedParameterKind::kRotation, index, 0});
  if (rotation >= 0) {
    for (int i = 0; i < 3; ++i) {
      const Eigen::Index w = rig.Row({ReducedParameterKind::kRotation, index, i});
      result.rotation_sigma_rad[i] = std::sqrt(std::max(0.0, rig.shape_covariance(w, w)));
    }
    const PointGainMatrix gain =
        AttachedPointGain(problem, rig, index, camera.cam_from_rig.SourceFromTargetTranslation());
    result.position_sigma_m =
        (gain * rig.shape_covariance * gain.transpose()).diagonal().cwiseMax(0).cwiseSqrt();
  }
  if (camera.intrinsics_fixed) return result;
  for (int i = 0; i < static_cast<int>(camera.intrinsics.size()); ++i) {
    const Eigen::Index row = rig.Row({ReducedParameterKind::kIntrinsic, index, i});
    result.intrinsics_sigma.push_back(
        row < 0 ? 0 : std::sqrt(std::max(0.0, rig.shape_covariance(row, row))));
  }
  return result;
}

// Derivatives of the distance that gives the scale, by row.
Eigen::VectorXd DistanceGradient(const BundleProblem& problem, const RigUncertainty& rig) {
  const BundleDistance& distance = *problem.distance;
  const RigidTransform& a = problem.cameras[static_cast<size_t>(distance.camera_a)].cam_from_rig;
  const RigidTransform& b = problem.cameras[static_cast<size_t>(distance.camera_b)].cam_from_rig;
  const Eigen::Vector3d direction =
      (b.SourceFromTargetTranslation() - a.SourceFromTargetTranslation()).normalized();
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(rig.covariance.rows());
  for (const bool is_a : {true, false}) {
    const int camera = is_a ? distance.camera_a : distance.camera_b;
    const RigidTransform& pose = is_a ? a : b;
    const Eigen::Vector3d outward = pose.rotation * Eigen::Vector3d(is_a ? -direction : direction);
    const Eigen::Vector3d turn = pose.translation_m.cross(outward);
    for (int i = 0; i < 3; ++i) {
      const Eigen::Index w = rig.Row({ReducedParameterKind::kRotation, camera, i});
      const Eigen::Index d = rig.Row({ReducedParameterKind::kTranslation, camera, i});
      if (w >= 0) gradient[w] = turn[i];
      if (d >= 0) gradient[d] = -outward[i];
    }
  }
  return gradient;
}

// The solver's hold on the distance is not what is known of it: that is `sigma_m`, 0 for a unit.
void DescribeDistance(const BundleProblem& problem, double sigma_m, RigUncertainty* rig) {
  const Eigen::VectorXd gradient = DistanceGradient(problem, *rig);
  const Eigen::VectorXd column = rig->covariance * gradient;
  const double variance = gradient.dot(column);
  rig->shape_covariance = rig->covariance - column * column.transpose() / variance;
  const double share = sigma_m / variance;
  rig->covariance = rig->shape_covariance + share * share * column * column.transpose();
  rig->scale_sigma_rel = sigma_m / problem.distance->distance_m;
}

// A scale as the target's own lengths have it: its error is `gradient` times the parameters'
// errors, and that of lengths that were not estimated.
struct TargetScale {
  Eigen::VectorXd gradient;
  double given_variance = 0;

  double Variance(const RigUncertainty& rig) const {
    return gradient.dot(rig.covariance * gradient) + given_variance;
  }
};

// The scale of a set of points is its size about the centroid: with p_m from there,
// scale - 1 = sum p_m . d_m / sum |p_m|^2 for displacements d_m of the points; of several parts,
// each about its own. None: every part is one point.
std::optional<TargetScale> RigidScale(const BundleProblem& problem, const RigUncertainty& rig) {
  const BundleRigidTarget& target = problem.rigid_target;
  std::vector<Eigen::Vector3d> from_middle;
  double size = 0;
  for (const auto& [first, last] : target.Parts()) {
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    const auto begin = target.points_m.begin() + first, end = target.points_m.begin() + last;
    for (auto point = begin; point != end; ++point) middle += *point / (last - first);
    for (auto point = begin; point != end; ++point) {
      from_middle.push_back(*point - middle);
      size += from_middle.back().squaredNorm();
    }
  }
  if (!(size > 0)) return std::nullopt;
  TargetScale scale{Eigen::VectorXd::Zero(rig.covariance.rows())};
  for (size_t m = 0; m < from_middle.size(); ++m) {
    for (int i = 0; i < 3; ++i) {
      const double slope = from_middle[m][i] / size;
      const Eigen::Index row =
          rig.Row({ReducedParameterKind::kTargetPoint, static_cast<int>(m), i});
      if (row >= 0) {
        scale.gradient[row] = slope;
      } else if (!target.sigma_m.empty()) {
        scale.given_variance += std::pow(slope * target.sigma_m[m], 2);
      }
    }
  }
  return scale;
}

// Of one wand.
TargetScale WandScale(const BundleTarget& target, const BundleWand& wand,
                      const RigUncertainty& rig) {
  const double length_m = target.marker_positions_m[static_cast<size_t>(wand.end) - 1];
  TargetScale scale{Eigen::VectorXd::Zero(rig.covariance.rows())};
  const Eigen::Index row = rig.Row({ReducedParameterKind::kMarkerPosition, wand.end - 1, 0});
  if (row >= 0) {
    scale.gradient[row] = 1 / length_m;
  } else {
    // Not estimated: the tolerance of the spans is all that is known.
    scale.given_variance = (wand.end - wand.first - 1) * std::pow(wand.span_sigma_m / length_m, 2);
  }
  return scale;
}

// Of every target that has lengths.
std::vector<TargetScale> ScalesOf(const BundleProblem& problem, const RigUncertainty& rig) {
  std::vector<TargetScale> scales;
  if (auto rigid = RigidScale(problem, rig)) scales.push_back(*std::move(rigid));
  for (const BundleWand& wand : problem.target.Wands()) {
    if (wand.end - wand.first > 1) scales.push_back(WandScale(problem.target, wand, rig));
  }
  return scales;
}

void DescribeMarkerPositions(const BundleProblem& problem, RigUncertainty* rig) {
  const int count = static_cast<int>(problem.target.marker_positions_m.size());
  for (int m = 0; m < count; ++m) {
    const Eigen::Index own = rig->Row({ReducedParameterKind::kMarkerPosition, m, 0});
    rig->marker_position_sigma_m.push_back(own < 0 ? 0 : std::sqrt(rig->covariance(own, own)));
  }
}

void DescribeScale(const BundleProblem& problem, RigUncertainty* rig) {
  rig->shape_covariance = rig->covariance;
  DescribeMarkerPositions(problem, rig);
  // Those that are estimated agree; of others the one that is known best counts.
  const std::vector<TargetScale> scales = ScalesOf(problem, *rig);
  const auto scale = std::ranges::min_element(
      scales, {}, [rig](const TargetScale& one) { return one.Variance(*rig); });
  if (scale == scales.end()) return;
  rig->scale_sigma_rel = std::sqrt(scale->Variance(*rig));
  const Eigen::VectorXd column = rig->covariance * scale->gradient;
  const double variance = scale->gradient.dot(column);
  if (variance > 0) rig->shape_covariance -= column * column.transpose() / variance;
}

absl::Status DescribeByInstants(const RigSolution& solution, RigUncertainty* result) {
  const BundleProblem& problem = solution.built.problem;
  const BundleOptions bundle;
  RIGCAL_ASSIGN_OR_RETURN(const ReducedInformation information,
                          ComputeInformation(bundle, problem));
  result->parameters = information.parameters;
  const Eigen::MatrixXd prior = PriorInformation(problem, result->parameters);
  const LossFactors loss =
      MeasureLossFactors(solution.built, bundle.loss_scale, information.information.rows());
  RIGCAL_ASSIGN_OR_RETURN(result->covariance,
                          Inverse((information.information - prior) / loss.variance + prior));
  AllowForCommonErrors(
      MeasureBlockScatter(solution.built, bundle, result->parameters, result->covariance, loss),
      prior, result);
  return absl::OkStatus();
}

// Every residual's leverage is the mean one: some are of rows that nobody else shares, which the
// path follows, but they say little.
absl::Status DescribeByPath(const TrajectoryFit& fit, RigUncertainty* result) {
  TrajectoryProblem problem = fit.problem;
  const BundleOptions bundle;
  TrajectorySystem system(bundle, &problem);
  if (!system.Linearise()) return absl::InternalError("uncertainty: the path is not determined");
  result->parameters = system.layout().parameters;
  const Eigen::MatrixXd information = system.matrix().selfadjointView<Eigen::Lower>();
  const Eigen::MatrixXd prior = PriorInformation(problem.rows, result->parameters);
  system.PreparePathCovariance();
  const double free = system.MeasureFreedom().values + static_cast<double>(information.rows());
  LossSum counted(bundle.loss_scale);
  ForEachUsedMarkerOfRows(
      problem, [&](size_t row, const BundleObservation& observation, const BundleMarker& marker) {
        if (problem.WhitenedResidual(row, observation, marker)) counted.Add(0, 1, 0);
      });
  const double leverage = std::min(kMaxLeverage, free / std::max(1.0, 2 * counted.count()));
  LossSum sum(bundle.loss_scale);
  std::map<int64_t, BlockInformation> blocks;
  system.ForEachReduced([&](size_t row, double weight, const Eigen::Vector2d& residual,
                            const Eigen::Matrix<double, 2, Eigen::Dynamic>& slope) {
    sum.Add(residual.squaredNorm(), 1, leverage);
    BlockInformation& block = blocks[fit.row_time_ns[row] / kPathBlockNs];
    if (block.score.size() == 0) {
      block.information = Eigen::MatrixXd::Zero(slope.cols(), slope.cols());
      block.score = Eigen::VectorXd::Zero(slope.cols());
    }
    block.information.noalias() += weight * slope.transpose() * slope;
    block.score.noalias() -= weight * slope.transpose() * residual;
  });
  const LossFactors loss = sum.Factors(free);
  RIGCAL_ASSIGN_OR_RETURN(result->covariance,
                          Inverse((information - prior) / loss.variance + prior));
  BlockScatterSum scatter(result->covariance, loss);
  for (const auto& [number, block] : blocks) scatter.Add(block);
  AllowForCommonErrors(scatter.Finish(), prior, result);
  return absl::OkStatus();
}

}  // namespace

Eigen::Index RigUncertainty::Row(const ReducedParameter& parameter) const {
  const auto found = std::find(parameters.begin(), parameters.end(), parameter);
  return found == parameters.end() ? -1 : found - parameters.begin();
}

double RigUncertainty::ClockSigma(ReducedParameterKind kind,
                                  const std::vector<double>& weights) const {
  Eigen::VectorXd row = Eigen::VectorXd::Zero(covariance.cols());
  for (size_t k = 0; k < weights.size(); ++k) {
    const Eigen::Index own = Row({kind, static_cast<int>(k), 0});
    if (own >= 0) row[own] = weights[k];
  }
  return std::sqrt(std::max(0.0, row.dot(covariance * row)));
}

void DescribeCameras(const BundleProblem& problem, RigUncertainty* uncertainty) {
  uncertainty->cameras.clear();
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    uncertainty->cameras.push_back(OfCamera(problem, static_cast<int>(c), *uncertainty));
  }
}

std::vector<double> PackCameraCovariance(const BundleProblem& problem, int reference_camera,
                                         const RigUncertainty& uncertainty) {
  const std::vector<Eigen::Index> rows = RowsOf(problem, reference_camera, uncertainty);
  std::vector<double> packed;
  packed.reserve(rows.size() * (rows.size() + 1) / 2);
  for (size_t i = 0; i < rows.size(); ++i) {
    for (size_t j = 0; j <= i; ++j) {
      packed.push_back(rows[i] < 0 || rows[j] < 0 ? 0
                                                  : uncertainty.shape_covariance(rows[i], rows[j]));
    }
  }
  return packed;
}

absl::StatusOr<RigUncertainty> ComputeUncertainty(const RigSolution& solution,
                                                  const RigSolveOptions& options) {
  const BundleProblem& problem = solution.built.problem;
  RigUncertainty result;
  if (solution.trajectory != nullptr) {
    RIGCAL_RETURN_IF_ERROR(DescribeByPath(*solution.trajectory, &result));
  } else {
    RIGCAL_RETURN_IF_ERROR(DescribeByInstants(solution, &result));
  }
  if (problem.distance) {
    DescribeDistance(problem, options.known_distance_sigma_m, &result);
  } else {
    DescribeScale(problem, &result);
  }
  if (options.held != nullptr) {
    RIGCAL_RETURN_IF_ERROR(AddHeldUncertainty(solution, *options.held, &result));
  }
  DescribeCameras(problem, &result);
  return result;
}

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/paper/spline_solve.h"

#include <ceres/ceres.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/camera/intrinsics_vector.h"
#include "common/camera/projection.h"
#include "common/status/status_macros.h"
#include "tests/accuracy/paper/paired_start.h"

namespace rigcal::accuracy {
namespace {

constexpr int kOrder = 6;     // of the spline: knots that a pose depends on
constexpr int kKnotSize = 7;  // x y z of the origin, metres; then the quaternion's x y z w
constexpr size_t kMinPairs = 10;
// One sigma of what holds the knots where there are no views: third differences, metres and units
// of the quaternion; and squared length of the quaternion.
constexpr double kThirdDifferenceSigma = 1, kLengthSigma = 0.1;

using Knot = Eigen::Matrix<double, kKnotSize, 1>;
using KnotWeights = std::array<double, kOrder>;

// Of the basis functions that are not zero in the interval that u in [0, 1) runs through; beyond it
// their polynomials go on. By the recursion of Cox and de Boor for even knots:
//   b_k,n(u) = ((u + n - 1 - k) b_k-1,n-1(u) + (k + 1 - u) b_k,n-1(u)) / (n - 1)
// and derivative b'_k,n = b_k-1,n-1 - b_k,n-1, per step.
void BasisAt(double u, KnotWeights* value, KnotWeights* slope) {
  KnotWeights basis{1};
  for (int n = 2; n <= kOrder; ++n) {
    KnotWeights next{};
    for (int k = 0; k < n; ++k) {
      const auto i = static_cast<size_t>(k);
      const double before = k > 0 ? basis[i - 1] : 0, same = k < n - 1 ? basis[i] : 0;
      next[i] = ((u + n - 1 - k) * before + (k + 1 - u) * same) / (n - 1);
      if (n == kOrder) (*slope)[i] = before - same;
    }
    basis = next;
  }
  *value = basis;
}

// One point in one view. Blocks: the knots, the camera's rotation (x y z w) and translation, and
// its clock offset.
class SplinePointCost final : public ceres::CostFunction {
 public:
  SplinePointCost(const server::BundleCamera& camera, const Eigen::Vector3d& point_m,
                  const Eigen::Vector2d& centre_px, const KnotWeights& value,
                  const KnotWeights& slope, double from_offset_s, double step_s)
      : model_(camera.model),
        intrinsics_(camera.intrinsics),
        point_m_(point_m),
        centre_px_(centre_px),
        value_(value),
        slope_(slope),
        from_offset_s_(from_offset_s),
        step_s_(step_s) {
    set_num_residuals(2);
    mutable_parameter_block_sizes()->assign(kOrder, kKnotSize);
    for (const int size : {4, 3, 1}) mutable_parameter_block_sizes()->push_back(size);
  }

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    // To first order in what the offset has changed by; the weights are those of the offset before.
    const double later_s = parameters[kOrder + 2][0] - from_offset_s_;
    Knot pose = Knot::Zero(), speed = Knot::Zero();
    KnotWeights weights;
    for (size_t k = 0; k < kOrder; ++k) {
      const Eigen::Map<const Knot> knot(parameters[k]);
      weights[k] = value_[k] + later_s / step_s_ * slope_[k];
      pose += weights[k] * knot;
      speed += slope_[k] / step_s_ * knot;
    }
    using Jet = ceres::Jet<double, 2 * kKnotSize>;
    Jet values[2 * kKnotSize], out[2];
    for (int i = 0; i < kKnotSize; ++i) values[i] = Jet(pose[i], i);
    for (int i = 0; i < 4; ++i) values[7 + i] = Jet(parameters[kOrder][i], 7 + i);
    for (int i = 0; i < 3; ++i) values[11 + i] = Jet(parameters[kOrder + 1][i], 11 + i);
    if (!Residual(values, out)) return false;
    for (int i = 0; i < 2; ++i) {
      residuals[i] = out[i].a;
      if (jacobians == nullptr) continue;
      const Knot by_pose = out[i].v.head<kKnotSize>();
      for (size_t k = 0; k < kOrder; ++k) {
        if (jacobians[k] == nullptr) continue;
        Eigen::Map<Knot>(jacobians[k] + i * kKnotSize) = weights[k] * by_pose;
      }
      if (double* const by_rotation = jacobians[kOrder]) {
        Eigen::Map<Eigen::Vector4d>(by_rotation + 4 * i) = out[i].v.segment<4>(7);
      }
      if (double* const by_translation = jacobians[kOrder + 1]) {
        Eigen::Map<Eigen::Vector3d>(by_translation + 3 * i) = out[i].v.segment<3>(11);
      }
      if (double* const by_offset = jacobians[kOrder + 2]) by_offset[i] = by_pose.dot(speed);
    }
    return true;
  }

 private:
  template <typename T>
  bool Residual(const T* values, T* out) const {
    using Vector = Eigen::Matrix<T, 3, 1>;
    const Eigen::Quaternion<T> target(
        Eigen::Quaternion<T>(values[6], values[3], values[4], values[5]).normalized());
    const Eigen::Quaternion<T> camera(values[10], values[7], values[8], values[9]);
    const Vector in_rig =
        target * Vector(point_m_.cast<T>()) + Vector(values[0], values[1], values[2]);
    const Vector in_cam = camera * in_rig + Vector(values[11], values[12], values[13]);
    if (!(in_cam.z() > T(1e-3))) return false;
    const T x_in_cam[3] = {in_cam.x(), in_cam.y(), in_cam.z()};
    ProjectedPoint<T> projected;
    ProjectPoint<false, false>(model_, intrinsics_.data(), x_in_cam, &projected);
    for (int i = 0; i < 2; ++i) out[i] = projected.pixel[i] - T(centre_px_[i]);
    return projected.visible > T(0);
  }

  const DistortionModel model_;
  const IntrinsicsVector intrinsics_;
  const Eigen::Vector3d point_m_;
  const Eigen::Vector2d centre_px_;
  const KnotWeights value_, slope_;
  const double from_offset_s_, step_s_;
};

struct ThirdDifference {
  template <typename T>
  bool operator()(const T* a, const T* b, const T* c, const T* d, T* residual) const {
    for (int i = 0; i < kKnotSize; ++i) {
      residual[i] = (d[i] - 3.0 * c[i] + 3.0 * b[i] - a[i]) / kThirdDifferenceSigma;
    }
    return true;
  }
};

struct QuaternionLength {
  template <typename T>
  bool operator()(const T* knot, T* residual) const {
    *residual =
        (knot[3] * knot[3] + knot[4] * knot[4] + knot[5] * knot[5] + knot[6] * knot[6] - 1.0) /
        kLengthSigma;
    return true;
  }
};

class SplineSolve {
 public:
  SplineSolve(const server::CalibrationInput& input, const SplineSolveOptions& options,
              const server::BundleProblem& start)
      : input_(input), options_(options), cameras_(start.cameras) {
    begin_ns_ = std::numeric_limits<int64_t>::max();
    int64_t end_ns = std::numeric_limits<int64_t>::min();
    for (const server::CameraTrack& track : input.tracks) {
      for (const Observation& row : track.observations) {
        if (row.VisibleCount() == 0) continue;
        begin_ns_ = std::min(begin_ns_, row.time_ns);
        end_ns = std::max(end_ns, row.time_ns);
      }
    }
    // One step of room for offsets at either end.
    const double length_s = 1e-9 * static_cast<double>(end_ns - begin_ns_);
    knots_.resize(static_cast<size_t>(std::ceil(length_s / options.step_s)) + kOrder + 2);
    for (const server::BundleCamera& camera : cameras_) {
      rotations_.push_back(camera.cam_from_rig.rotation.normalized());
      translations_.push_back(camera.cam_from_rig.translation_m);
    }
    offsets_s_.resize(cameras_.size());
  }

  // Each knot is the pose where its basis function is highest.
  void StartKnots(const std::map<int64_t, Knot>& poses) {
    for (size_t k = 0; k < knots_.size(); ++k) {
      const double at_s = (static_cast<double>(k) - 0.5 * kOrder) * options_.step_s;
      const int64_t at_ns = begin_ns_ + std::llround(1e9 * at_s);
      auto after = poses.lower_bound(at_ns);
      if (after == poses.end()) --after;
      const auto before = after == poses.begin() ? after : std::prev(after);
      const double span = static_cast<double>(after->first - before->first);
      const double share =
          span > 0 ? std::clamp(static_cast<double>(at_ns - before->first) / span, 0.0, 1.0) : 0;
      knots_[k] = before->second + share * (after->second - before->second);
      knots_[k].tail<4>().normalize();
    }
  }

  absl::Status Solve() {
    for (int round = 0; round < options_.rounds; ++round) {
      const std::vector<double> before_s = offsets_s_;
      RIGCAL_RETURN_IF_ERROR(SolveRound());
      double changed_s = 0;
      for (size_t c = 0; c < offsets_s_.size(); ++c) {
        changed_s = std::max(changed_s, std::abs(offsets_s_[c] - before_s[c]));
      }
      if (changed_s < options_.settled_s) break;
    }
    return absl::OkStatus();
  }

  void Store(CalibrationResult* result) const {
    for (size_t c = 0; c < cameras_.size(); ++c) {
      CalibratedCamera& camera = result->cameras[c];
      camera.cam_from_rig = {rotations_[c].normalized(), translations_[c]};
      camera.time_offset_s = offsets_s_[c];
      ErrorFigures& all = camera.residuals.all;
      double sum_px = 0, squares_px2 = 0;
      ForEachPoint(c, [&](const auto& cost, const std::vector<const double*>& blocks) {
        Eigen::Vector2d residual;
        if (!cost->Evaluate(blocks.data(), residual.data(), nullptr)) return;
        sum_px += residual.norm();
        squares_px2 += residual.squaredNorm();
        ++all.marker_count;
      });
      if (all.marker_count > 0) {
        all.mean_px = sum_px / all.marker_count;
        all.rms_px = std::sqrt(squares_px2 / all.marker_count);
      }
      camera.residuals.inlier = all;
    }
  }

 private:
  // Calls visit(cost, blocks) for every point that camera c sees.
  template <typename Visit>
  void ForEachPoint(size_t c, const Visit& visit) const {
    for (const Observation& row : input_.tracks[c].observations) {
      const double time_s = 1e-9 * static_cast<double>(row.time_ns - begin_ns_) + offsets_s_[c];
      const double step = time_s / options_.step_s + 1;
      const auto first = static_cast<size_t>(
          std::clamp(std::floor(step), 0.0, static_cast<double>(knots_.size() - kOrder)));
      KnotWeights value, slope;
      BasisAt(step - static_cast<double>(first), &value, &slope);
      for (size_t m = 0; m < row.markers.size(); ++m) {
        if (!row.markers[m].visible) continue;
        const TargetPoint& point = input_.target.points[m];
        std::vector<const double*> blocks;
        for (size_t k = 0; k < kOrder; ++k) blocks.push_back(knots_[first + k].data());
        blocks.push_back(rotations_[c].coeffs().data());
        blocks.push_back(translations_[c].data());
        blocks.push_back(&offsets_s_[c]);
        visit(std::make_unique<SplinePointCost>(
                  cameras_[c], Eigen::Vector3d(point.x_m, point.y_m, point.z_m),
                  row.markers[m].centre_px, value, slope, offsets_s_[c], options_.step_s),
              blocks);
      }
    }
  }

  absl::Status SolveRound() {
    ceres::Problem problem;
    const auto mutable_blocks = [](const std::vector<const double*>& blocks) {
      std::vector<double*> all;
      for (const double* block : blocks) all.push_back(const_cast<double*>(block));
      return all;
    };
    for (size_t c = 0; c < cameras_.size(); ++c) {
      ForEachPoint(c, [&](auto cost, const std::vector<const double*>& blocks) {
        problem.AddResidualBlock(cost.release(), new ceres::CauchyLoss(options_.loss_px),
                                 mutable_blocks(blocks));
      });
      double* const rotation = rotations_[c].coeffs().data();
      if (!problem.HasParameterBlock(rotation)) continue;
      problem.SetManifold(rotation, new ceres::EigenQuaternionManifold);
      if (c > 0) continue;
      problem.SetParameterBlockConstant(rotation);
      problem.SetParameterBlockConstant(translations_[c].data());
      problem.SetParameterBlockConstant(&offsets_s_[c]);
    }
    for (size_t k = 0; k < knots_.size(); ++k) {
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<QuaternionLength, 1, kKnotSize>(new QuaternionLength),
          nullptr, knots_[k].data());
      if (k + 3 >= knots_.size()) continue;
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<ThirdDifference, kKnotSize, kKnotSize, kKnotSize,
                                          kKnotSize, kKnotSize>(new ThirdDifference),
          nullptr, knots_[k].data(), knots_[k + 1].data(), knots_[k + 2].data(),
          knots_[k + 3].data());
    }
    ceres::Solver::Options solver;
    solver.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
    solver.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;
    solver.num_threads = 1;
    solver.max_num_iterations = options_.max_iterations;
    solver.function_tolerance = 1e-9;
    solver.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(solver, &problem, &summary);
    if (!summary.IsSolutionUsable()) {
      return absl::FailedPreconditionError(
          absl::StrCat("the spline was not solved: ", summary.message));
    }
    return absl::OkStatus();
  }

  const server::CalibrationInput& input_;
  const SplineSolveOptions& options_;
  const std::vector<server::BundleCamera> cameras_;
  int64_t begin_ns_ = 0;
  std::vector<Knot> knots_;
  std::vector<Eigen::Quaterniond> rotations_;
  std::vector<Eigen::Vector3d> translations_;
  std::vector<double> offsets_s_;
};

}  // namespace

absl::StatusOr<CalibrationResult> SolveSpline(const server::CalibrationInput& input,
                                              const SplineSolveOptions& options) {
  if (input.target.IsLine() || input.tracks.empty()) {
    return absl::InvalidArgumentError("the spline is solved from rows of a rigid target");
  }
  const int64_t period_ns = std::llround(1e9 / options.pairing_hz);
  std::map<int64_t, PairedRows> by_period;
  for (size_t c = 0; c < input.tracks.size(); ++c) {
    for (const Observation& row : input.tracks[c].observations) {
      if (row.VisibleCount() == 0) continue;
      by_period[(row.time_ns + period_ns / 2) / period_ns].emplace_back(static_cast<int>(c), &row);
    }
  }
  std::vector<PairedRows> instants;
  for (const auto& [period, rows] : by_period) instants.push_back(rows);
  const auto pairs = static_cast<size_t>(
      std::ranges::count_if(instants, [](const PairedRows& rows) { return rows.size() > 1; }));
  if (pairs < kMinPairs) {
    return absl::FailedPreconditionError(absl::StrCat("two cameras see the target at once ", pairs,
                                                      " times, fewer than ", kMinPairs));
  }
  RIGCAL_ASSIGN_OR_RETURN(const server::BundleProblem start, StartFromPairs(input, instants));
  std::map<int64_t, Knot> poses;
  Eigen::Vector4d last = Eigen::Vector4d::Zero();
  for (size_t i = 0; i < instants.size(); ++i) {
    if (!start.instants[i].used) continue;
    // Of q and -q, which are one rotation, the one nearer to the pose before.
    Eigen::Vector4d rotation = start.instants[i].rotation.coeffs();
    if (rotation.dot(last) < 0) rotation = -rotation;
    last = rotation;
    Knot& pose = poses[instants[i].front().second->time_ns];
    pose << start.instants[i].origin_m, rotation;
  }
  if (poses.empty()) {
    return absl::FailedPreconditionError("the target was placed in no view");
  }
  SplineSolve solve(input, options, start);
  solve.StartKnots(poses);
  RIGCAL_RETURN_IF_ERROR(solve.Solve());
  CalibrationResult result = ResultOf(input, start);
  result.instant_count = static_cast<uint32_t>(instants.size());
  solve.Store(&result);
  std::ranges::sort(result.cameras, {}, &CalibratedCamera::camera);
  return result;
}

}  // namespace rigcal::accuracy

// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/calibration_error.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <random>

#include "common/statistics/robust_statistics.h"

namespace rigcal::server {
namespace {

constexpr int kDraws = 64;
constexpr double kPercentile = 0.95, kBoundProbability = 0.95;
constexpr double kMinRaySpread = 1e-3;  // least to largest information, by direction

// Square root of a covariance: cov = root * root^T. Directions without variance give zero columns.
Eigen::MatrixXd SquareRoot(const Eigen::MatrixXd& covariance) {
  const Eigen::LDLT<Eigen::MatrixXd> factor(covariance);
  const Eigen::VectorXd deviations = factor.vectorD().cwiseMax(0).cwiseSqrt();
  Eigen::MatrixXd root = Eigen::MatrixXd(factor.matrixL()) * deviations.asDiagonal();
  return factor.transpositionsP().transpose() * root;
}

// The same numbers in every process: C++'s normal distribution is not portable, these are.
Eigen::MatrixXd StandardNormal(Eigen::Index rows, Eigen::Index columns) {
  std::mt19937 bits(1);
  const auto uniform = [&bits] { return (static_cast<double>(bits()) + 0.5) / 4294967296.0; };
  Eigen::MatrixXd values(rows, columns);
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    // Box and Muller, A Note on the Generation of Random Normal Deviates, 1958.
    const double radius = std::sqrt(-2 * std::log(uniform()));
    values.data()[i] = radius * std::cos(2 * M_PI * uniform());
  }
  return values;
}

}  // namespace

bool AreRaysApart(const Eigen::Matrix3d& normal) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(normal, Eigen::EigenvaluesOnly);
  return eigen.eigenvalues()[0] > kMinRaySpread * eigen.eigenvalues()[2];
}

RigidMotion FindRigidMotion(const std::vector<Eigen::Vector3d>& points_m,
                            const PointGainMatrix& gain) {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point_m : points_m) centre += point_m;
  centre /= static_cast<double>(points_m.size());
  RigidMotion rigid;
  Eigen::Matrix<double, Eigen::Dynamic, 6>& motions = rigid.motions;
  motions.resize(gain.rows(), 6);
  for (size_t i = 0; i < points_m.size(); ++i) {
    const Eigen::Vector3d p = points_m[i] - centre;
    motions.middleRows<3>(static_cast<Eigen::Index>(3 * i)) << 1, 0, 0, 0, p.z(), -p.y(), 0, 1, 0,
        -p.z(), 0, p.x(), 0, 0, 1, p.y(), -p.x(), 0;
  }
  const Eigen::Matrix<double, 6, 6> normal = motions.transpose() * motions;
  rigid.taken = normal.ldlt().solve(motions.transpose() * gain);
  if (!rigid.taken.allFinite()) rigid.taken.setZero();
  return rigid;
}

void RemoveRigidMotion(const std::vector<Eigen::Vector3d>& points_m, PointGainMatrix* gain) {
  if (points_m.empty()) return;
  const RigidMotion rigid = FindRigidMotion(points_m, *gain);
  gain->noalias() -= rigid.motions * rigid.taken;
}

CalibrationError ComputeCalibrationError(const std::vector<Eigen::Vector3d>& points_m,
                                         PointGainMatrix gain, const Eigen::MatrixXd& covariance) {
  CalibrationError error;
  if (points_m.empty()) return error;
  RemoveRigidMotion(points_m, &gain);
  const Eigen::MatrixXd root = SquareRoot(covariance);
  const Eigen::MatrixXd factor = gain * root;
  const Eigen::MatrixXd moved = factor * StandardNormal(root.cols(), kDraws);
  const auto count = static_cast<Eigen::Index>(points_m.size());
  for (Eigen::Index i = 0; i < count; ++i) {
    error.sigma_m.push_back(factor.middleRows<3>(3 * i).norm());
  }
  error.rms_m = std::sqrt(factor.squaredNorm() / static_cast<double>(count));
  std::vector<double> percentiles, drawn(points_m.size());
  for (int k = 0; k < kDraws; ++k) {
    for (Eigen::Index i = 0; i < count; ++i) {
      drawn[static_cast<size_t>(i)] = moved.col(k).segment<3>(3 * i).norm();
    }
    percentiles.push_back(UpperQuantile(&drawn, kPercentile));
  }
  error.p95_bound_m = UpperQuantile(&percentiles, kBoundProbability);
  error.p95_m = UpperMedian(&percentiles);
  error.median_m = UpperMedian(error.sigma_m);
  return error;
}

}  // namespace rigcal::server

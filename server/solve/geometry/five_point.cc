// SPDX-License-Identifier: Apache-2.0
#include "server/solve/geometry/five_point.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>

namespace rigcal::server {
namespace {

// Monomials of x, y, z by their exponents: those of degree 3, then those of the action matrix.
constexpr size_t kCubics = 10, kMonomials = 20;
struct Exponents {
  int x, y, z;
};
constexpr std::array<Exponents, kMonomials> kExponents = {{
    {3, 0, 0}, {2, 1, 0}, {1, 2, 0}, {0, 3, 0}, {2, 0, 1}, {1, 1, 1},
    {0, 2, 1}, {1, 0, 2}, {0, 1, 2}, {0, 0, 3},                        // degree 3
    {2, 0, 0}, {1, 1, 0}, {0, 2, 0}, {1, 0, 1}, {0, 1, 1}, {0, 0, 2},  // degree 2
    {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0},
}};
constexpr size_t kX = 16, kY = 17, kZ = 18, kOne = 19;

constexpr size_t IndexOf(Exponents wanted) {
  size_t i = 0;
  while (kExponents[i].x != wanted.x || kExponents[i].y != wanted.y ||
         kExponents[i].z != wanted.z) {
    ++i;
  }
  return i;
}

constexpr size_t IndexOfProduct(size_t a, size_t b) {
  return IndexOf({kExponents[a].x + kExponents[b].x, kExponents[a].y + kExponents[b].y,
                  kExponents[a].z + kExponents[b].z});
}

// Of a monomial of degree 2 or less (from 10 on) and one of degree 1 or less (from 16 on).
struct ProductTable {
  std::array<std::array<size_t, 4>, kCubics> index = {};
  constexpr ProductTable() {
    for (size_t a = 0; a < kCubics; ++a) {
      for (size_t b = 0; b < 4; ++b) index[a][b] = IndexOfProduct(kCubics + a, kX + b);
    }
  }
};
constexpr ProductTable kProduct;

using LinearPolynomial = Eigen::Vector4d;                       // x, y, z, 1
using QuadraticPolynomial = Eigen::Matrix<double, kCubics, 1>;  // monomials from 10 on
using CubicPolynomial = Eigen::Matrix<double, kMonomials, 1>;

void AddProduct(const LinearPolynomial& a, const LinearPolynomial& b, double factor,
                QuadraticPolynomial* sum) {
  for (size_t i = 0; i < 4; ++i) {
    for (size_t k = 0; k < 4; ++k) {
      (*sum)[static_cast<Eigen::Index>(kProduct.index[kX - kCubics + i][k] - kCubics)] +=
          factor * a[static_cast<Eigen::Index>(i)] * b[static_cast<Eigen::Index>(k)];
    }
  }
}

void AddProduct(const QuadraticPolynomial& a, const LinearPolynomial& b, CubicPolynomial* sum) {
  for (size_t i = 0; i < kCubics; ++i) {
    for (size_t k = 0; k < 4; ++k) {
      (*sum)[static_cast<Eigen::Index>(kProduct.index[i][k])] +=
          a[static_cast<Eigen::Index>(i)] * b[static_cast<Eigen::Index>(k)];
    }
  }
}

using CubicEquations = Eigen::Matrix<double, kCubics, kMonomials>;

// `entry[3 * row + column]` of the essential matrix, a combination of four.
CubicEquations EquationsOf(const std::array<LinearPolynomial, 9>& entry) {
  const auto at = [&entry](int row, int column) -> const LinearPolynomial& {
    return entry[static_cast<size_t>(3 * row + column)];
  };
  CubicEquations equations;
  // E E^T - trace(E E^T) / 2.
  QuadraticPolynomial square[3][3];
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      square[i][k].setZero();
      for (int m = 0; m < 3; ++m) AddProduct(at(i, m), at(k, m), 1, &square[i][k]);
    }
  }
  const QuadraticPolynomial half = 0.5 * (square[0][0] + square[1][1] + square[2][2]);
  for (int i = 0; i < 3; ++i) square[i][i] -= half;
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      CubicPolynomial sum = CubicPolynomial::Zero();
      for (int m = 0; m < 3; ++m) AddProduct(square[i][m], at(m, k), &sum);
      equations.row(3 * i + k) = sum;
    }
  }
  CubicPolynomial determinant = CubicPolynomial::Zero();
  for (int k = 0; k < 3; ++k) {
    const int next = (k + 1) % 3, last = (k + 2) % 3;
    QuadraticPolynomial minor = QuadraticPolynomial::Zero();
    AddProduct(at(1, next), at(2, last), 1, &minor);
    AddProduct(at(1, last), at(2, next), -1, &minor);
    AddProduct(minor, at(0, k), &determinant);
  }
  equations.row(9) = determinant;
  return equations;
}

}  // namespace

std::vector<Eigen::Matrix3d> EssentialsOfFivePoints(std::span<const RayPair> five) {
  std::vector<Eigen::Matrix3d> essentials;
  if (five.size() != 5) return essentials;
  Eigen::Matrix<double, 9, 5> constraints;
  for (Eigen::Index i = 0; i < 5; ++i) {
    const RayPair& pair = five[static_cast<size_t>(i)];
    const Eigen::Vector3d a = pair.a.homogeneous(), b = pair.b.homogeneous();
    for (Eigen::Index row = 0; row < 3; ++row) constraints.col(i).segment<3>(3 * row) = b[row] * a;
  }
  // The last four columns of Q are orthogonal to the constraints.
  const Eigen::HouseholderQR<Eigen::Matrix<double, 9, 5>> qr(constraints);
  Eigen::Matrix<double, 9, 4> basis = Eigen::Matrix<double, 9, 4>::Zero();
  basis.bottomRows<4>().setIdentity();
  basis.applyOnTheLeft(qr.householderQ());
  std::array<LinearPolynomial, 9> entry;
  for (size_t i = 0; i < 9; ++i) entry[i] = basis.row(static_cast<Eigen::Index>(i)).transpose();
  const CubicEquations equations = EquationsOf(entry);
  using Square = Eigen::Matrix<double, kCubics, kCubics>;
  const Eigen::PartialPivLU<Square> lu(equations.leftCols<kCubics>());
  const Square lower = lu.solve(equations.rightCols<kCubics>());
  if (!lower.allFinite()) return essentials;
  // x times each of the lower monomials, in terms of them.
  Square action = Square::Zero();
  for (size_t i = 0; i < kCubics; ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    const size_t product = kProduct.index[i][0];
    if (product < kCubics) {
      action.row(row) = -lower.row(static_cast<Eigen::Index>(product));
    } else {
      action(row, static_cast<Eigen::Index>(product - kCubics)) = 1;
    }
  }
  const Eigen::EigenSolver<Square> eigen(action);
  if (eigen.info() != Eigen::Success) return essentials;
  for (Eigen::Index i = 0; i < static_cast<Eigen::Index>(kCubics); ++i) {
    const std::complex<double> x = eigen.eigenvalues()[i];
    if (std::abs(x.imag()) > 1e-6 * (1 + std::abs(x.real()))) continue;
    const auto vector = eigen.eigenvectors().col(i).real();
    const double one = vector[kOne - kCubics];
    const Eigen::Vector4d combination(vector[kX - kCubics], vector[kY - kCubics],
                                      vector[kZ - kCubics], one);
    const Eigen::Matrix<double, 9, 1> flat = basis * combination;
    const double norm = flat.norm();
    if (!(norm > 1e-12) || !std::isfinite(norm)) continue;
    Eigen::Matrix3d essential;
    for (int row = 0; row < 3; ++row) {
      essential.row(row) = flat.segment<3>(3 * row).transpose() / norm;
    }
    essentials.push_back(essential);
  }
  return essentials;
}

}  // namespace rigcal::server

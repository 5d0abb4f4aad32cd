// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/kept_lenses.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace rigcal::server::kept_lenses_test {
namespace {

constexpr int kCameras = 4, kEach = 4;
constexpr Eigen::Index kLenses = kCameras * kEach;
constexpr double kPriorSigma = 2;

// Four cameras with four intrinsics each, and three numbers more that the data measure together
// with them: those of a pose. The priors of the intrinsics are at zero, and wide.
class KeptLensesFixture : public ::testing::Test {
 protected:
  KeptLensesFixture() {
    const Eigen::Index n = kLenses + 3;
    Eigen::MatrixXd mix(2 * n, n);
    for (Eigen::Index i = 0; i < mix.size(); ++i) mix.data()[i] = 3 * normal_(random_);
    data_ = mix.transpose() * mix;
    information_ = data_;
    for (Eigen::Index i = 0; i < kLenses; ++i) {
      information_(i, i) += 1 / (kPriorSigma * kPriorSigma);
    }
    uncertainty_.noise_covariance = information_.inverse();
    uncertainty_.covariance = uncertainty_.noise_covariance;
    for (int c = 0; c < kCameras; ++c) {
      BundleCamera camera;
      kept_.push_back(camera);
      camera.intrinsics_fixed = false;
      camera.intrinsics_mean = IntrinsicsVector::Zero(kEach);
      camera.intrinsics_sigma = IntrinsicsVector::Constant(kEach, kPriorSigma);
      refined_.cameras.push_back(camera);
      for (int i = 0; i < kEach; ++i) {
        uncertainty_.parameters.push_back({ReducedParameterKind::kIntrinsic, c, i});
      }
    }
    for (int i = 0; i < 3; ++i) {
      uncertainty_.parameters.push_back({ReducedParameterKind::kTranslation, 1, i});
    }
  }

  // True values drawn with lenses that are off by `sigma`, one sigma; what the data say of them;
  // and the estimates with refined lenses.
  Eigen::VectorXd Draw(double sigma) {
    Eigen::VectorXd truth = Eigen::VectorXd::Zero(data_.rows()), noise(data_.rows());
    for (Eigen::Index i = 0; i < kLenses; ++i) truth[i] = sigma * normal_(random_);
    for (double& value : noise) value = normal_(random_);
    pull_ = data_ * truth + data_.llt().matrixL() * noise;
    const Eigen::VectorXd estimate = uncertainty_.noise_covariance * pull_;
    for (int c = 0; c < kCameras; ++c) {
      refined_.cameras[static_cast<size_t>(c)].intrinsics = estimate.segment(kEach * c, kEach);
    }
    return truth;
  }

  // Of the pose, where the lenses are kept at zero.
  Eigen::Vector3d PoseWithKept() const {
    return data_.bottomRightCorner<3, 3>().llt().solve(pull_.tail<3>());
  }

  KeptLenses Measure(double design_effect = 1) const {
    return MeasureKeptLenses(kept_, refined_, uncertainty_, design_effect);
  }

  std::mt19937 random_{11};
  std::normal_distribution<double> normal_;
  Eigen::MatrixXd data_, information_;
  Eigen::VectorXd pull_;
  std::vector<BundleCamera> kept_;
  BundleProblem refined_;
  RigUncertainty uncertainty_;
};

TEST_F(KeptLensesFixture, ExactLensesAddLittleToTheNoise) {
  const Eigen::Matrix3d noise = data_.bottomRightCorner<3, 3>().inverse();
  const Eigen::MatrixXd refined = uncertainty_.noise_covariance.bottomRightCorner<3, 3>();
  double added = 0;
  for (int i = 0; i < 300; ++i) {
    Draw(0);
    const KeptLenses lenses = Measure();
    if (lenses.spread > 0) added += lenses.moment.bottomRightCorner<3, 3>().trace() / 300;
  }
  // The noise of the refined solution would be much more.
  EXPECT_LT(added, 0.3 * (refined.trace() - noise.trace()));
}

TEST_F(KeptLensesFixture, TheSpreadOfLensesThatAreOffIsFound) {
  double square = 0;
  for (int i = 0; i < 300; ++i) {
    Draw(0.5);
    square += std::pow(kPriorSigma * Measure().spread, 2) / 300;
  }
  EXPECT_NEAR(std::sqrt(square), 0.5, 0.05);
}

// Neither too large nor too small, and in the mean over the rigs: of 900 squares.
TEST_F(KeptLensesFixture, WhatIsStatedOfThePoseIsItsError) {
  for (const double sigma : {0.1, 0.5, 2.0}) {
    double squares = 0, stated = 0;
    for (int i = 0; i < 300; ++i) {
      const Eigen::VectorXd truth = Draw(sigma);
      squares += (PoseWithKept() - truth.tail<3>()).squaredNorm();
      RigUncertainty own;
      own.parameters.assign(uncertainty_.parameters.end() - 3, uncertainty_.parameters.end());
      own.covariance = own.shape_covariance = data_.bottomRightCorner<3, 3>().inverse();
      const RigUncertainty all = WithKeptLenses(own, Measure());
      for (int k = 0; k < 3; ++k) {
        const Eigen::Index row = all.Row({ReducedParameterKind::kTranslation, 1, k});
        stated += all.shape_covariance(row, row);
      }
    }
    EXPECT_NEAR(std::sqrt(squares / stated), 1, 0.15) << sigma;
  }
}

TEST_F(KeptLensesFixture, ErrorsInCommonMakeLensesLookOff) {
  int by_noise = 0, by_common = 0;
  for (int i = 0; i < 100; ++i) {
    Draw(0);
    for (BundleCamera& camera : refined_.cameras) camera.intrinsics *= 2;
    by_noise += Measure().spread > 0 ? 1 : 0;
    by_common += Measure(4).spread > 0 ? 1 : 0;
  }
  EXPECT_GT(by_noise, 95);
  EXPECT_LT(by_common, 80);
}

TEST_F(KeptLensesFixture, LensesThatWereRefinedAreNotKept) {
  Draw(0.5);
  for (BundleCamera& camera : kept_) camera.intrinsics_fixed = false;
  EXPECT_EQ(Measure().spread, 0);
  const RigUncertainty same = WithKeptLenses(uncertainty_, Measure());
  EXPECT_EQ(same.parameters.size(), uncertainty_.parameters.size());
  EXPECT_EQ(same.covariance, uncertainty_.covariance);
}

TEST_F(KeptLensesFixture, OfWhatIsNotFiniteNothingIsSaid) {
  Draw(0.5);
  uncertainty_.noise_covariance(0, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(Measure().spread, 0);
  uncertainty_.parameters.clear();
  EXPECT_EQ(Measure().spread, 0);
}

}  // namespace
}  // namespace rigcal::server::kept_lenses_test

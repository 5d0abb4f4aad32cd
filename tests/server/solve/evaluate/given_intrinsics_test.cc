// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/given_intrinsics.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <random>

namespace rigcal::server::given_intrinsics_test {
namespace {

constexpr int kCameras = 3, kEach = 4;

// Measurements of the intrinsics of three cameras whose errors go together, as a solve has them,
// and the solution with priors at zero.
class GivenIntrinsicsFixture : public ::testing::Test {
 protected:
  GivenIntrinsicsFixture() {
    constexpr Eigen::Index n = kCameras * kEach;
    Eigen::MatrixXd mix(2 * n, n);
    for (Eigen::Index i = 0; i < mix.size(); ++i) mix.data()[i] = normal_(random_);
    mix.col(3) *= 1e-3;  // of the first camera: the data say next to nothing about it
    data_ = mix.transpose() * mix;
    prior_ = Eigen::VectorXd::Constant(n, 1 / (kPriorSigma * kPriorSigma));
    uncertainty_.noise_covariance =
        Eigen::MatrixXd(data_ + Eigen::MatrixXd(prior_.asDiagonal())).inverse();
    for (int c = 0; c < kCameras; ++c) {
      BundleCamera camera;
      camera.intrinsics_mean = IntrinsicsVector::Zero(kEach);
      camera.intrinsics_sigma = IntrinsicsVector::Constant(kEach, kPriorSigma);
      problem_.cameras.push_back(camera);
      for (int i = 0; i < kEach; ++i) {
        uncertainty_.parameters.push_back({ReducedParameterKind::kIntrinsic, c, i});
      }
    }
  }

  // Estimates of the intrinsics for these true ones.
  GivenIntrinsicsTest TestOne(const Eigen::VectorXd& truth) {
    Eigen::VectorXd noise(truth.size());
    for (double& value : noise) value = normal_(random_);
    // Information times estimate: of the data alone.
    const Eigen::VectorXd pull = data_ * truth + data_.llt().matrixL() * noise;
    const Eigen::VectorXd estimate = uncertainty_.noise_covariance * pull;
    for (int c = 0; c < kCameras; ++c) {
      problem_.cameras[static_cast<size_t>(c)].intrinsics = estimate.segment(kEach * c, kEach);
    }
    return TestGivenIntrinsics(problem_, uncertainty_, 0.05);
  }

  static constexpr double kPriorSigma = 3;
  std::mt19937 random_{7};
  std::normal_distribution<double> normal_;
  Eigen::MatrixXd data_;
  Eigen::VectorXd prior_;
  BundleProblem problem_;
  RigUncertainty uncertainty_;
};

TEST_F(GivenIntrinsicsFixture, TrueOnesAreSeldomRejected) {
  int rejected = 0;
  for (int i = 0; i < 2000; ++i) {
    rejected += TestOne(Eigen::VectorXd::Zero(kCameras * kEach)).agrees ? 0 : 1;
  }
  // At most 5 %, and not far below: cameras and the whole are not independent of each other.
  EXPECT_LT(rejected, 120);
  EXPECT_GT(rejected, 30);
}

TEST_F(GivenIntrinsicsFixture, TheCameraThatIsOffIsNamed) {
  Eigen::VectorXd truth = Eigen::VectorXd::Zero(kCameras * kEach);
  truth[kEach + 1] = 4;  // sigmas are about a quarter
  int named = 0, blamed = 0;
  for (int i = 0; i < 200; ++i) {
    const GivenIntrinsicsTest test = TestOne(truth);
    EXPECT_FALSE(test.agrees);
    named += test.disagrees[1] ? 1 : 0;
    blamed += test.disagrees[0] || test.disagrees[2] ? 1 : 0;
  }
  EXPECT_EQ(named, 200);
  EXPECT_LT(blamed, 20);
}

TEST_F(GivenIntrinsicsFixture, ManySmallDifferencesAreSeenTogether) {
  int alone = 0, together = 0;
  for (int i = 0; i < 200; ++i) {
    const GivenIntrinsicsTest test = TestOne(Eigen::VectorXd::Constant(kCameras * kEach, 0.4));
    together += test.agrees ? 0 : 1;
    alone += test.disagrees[0] || test.disagrees[1] || test.disagrees[2] ? 1 : 0;
  }
  EXPECT_GT(together, alone);
}

TEST_F(GivenIntrinsicsFixture, NothingRefinedAgrees) {
  uncertainty_.parameters.clear();
  EXPECT_TRUE(TestGivenIntrinsics(problem_, uncertainty_).agrees);
}

TEST_F(GivenIntrinsicsFixture, PriorSharesArePartsOfTheVariance) {
  const std::vector<Eigen::Vector4d> shares = PriorShares(problem_, uncertainty_);
  ASSERT_EQ(shares.size(), kCameras);
  EXPECT_GT(shares[0][3], 0.99);
  // What is not the prior's is the data's.
  const Eigen::MatrixXd& covariance = uncertainty_.noise_covariance;
  const Eigen::MatrixXd of_data = covariance * data_ * covariance;
  for (int c = 0; c < kCameras; ++c) {
    for (int k = 0; k < kEach; ++k) {
      const Eigen::Index i = kEach * c + k;
      EXPECT_NEAR(shares[static_cast<size_t>(c)][k], 1 - of_data(i, i) / covariance(i, i), 1e-9);
    }
  }
}

// A factor that all have in common, and the data do not tell: no single sigma shows it.
TEST_F(GivenIntrinsicsFixture, PriorSharesShowWhatTheDataDoNotTellTogether) {
  constexpr Eigen::Index n = kCameras * kEach;
  const Eigen::VectorXd common = Eigen::VectorXd::Constant(n, 1 / std::sqrt(n));
  const Eigen::MatrixXd tells =
      100 * (Eigen::MatrixXd::Identity(n, n) - common * common.transpose());
  uncertainty_.noise_covariance = (tells + Eigen::MatrixXd(prior_.asDiagonal())).inverse();
  EXPECT_LT(std::sqrt(uncertainty_.noise_covariance(0, 0)), 0.3 * kPriorSigma);
  EXPECT_GT(PriorShares(problem_, uncertainty_)[0][0], 0.9);
}

}  // namespace
}  // namespace rigcal::server::given_intrinsics_test

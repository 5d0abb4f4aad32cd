// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/moved_set.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace rigcal::server::moved_set_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr double kSigma = 1e-3, kFrameSigma = 0.3;

// Poses with independent errors, and a common freedom: every pose is shifted alike.
class Rig {
 public:
  Rig(int cameras, uint32_t seed) : covariance_(6 * cameras, 6 * cameras) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    const Eigen::VectorXd common =
        kFrameSigma * Eigen::VectorXd::NullaryExpr(6, [&] { return normal(random); });
    covariance_ = kSigma * kSigma * Eigen::MatrixXd::Identity(6 * cameras, 6 * cameras);
    difference.resize(6 * cameras);
    for (int c = 0; c < cameras; ++c) {
      for (int i = 0; i < 6; ++i) difference[6 * c + i] = common[i] + kSigma * normal(random);
      for (int d = 0; d < cameras; ++d) {
        covariance_.block<6, 6>(6 * c, 6 * d).diagonal().array() += kFrameSigma * kFrameSigma;
      }
    }
  }
  void Move(int camera, double sigmas) { difference[6 * camera + 1] += sigmas * kSigma; }
  MovedSet Find() const { return FindMovedSet(difference, covariance_); }

  Eigen::VectorXd difference;

 private:
  Eigen::MatrixXd covariance_;
};

TEST(MovedSet, NothingMovesByChance) {
  for (uint32_t seed = 1; seed <= 200; ++seed) {
    const MovedSet found = Rig(6, seed).Find();
    EXPECT_THAT(found.moved, IsEmpty()) << "seed " << seed;
    EXPECT_EQ(found.problem, "") << "seed " << seed;
  }
}

TEST(MovedSet, NamesTheMovedCameras) {
  for (uint32_t seed = 1; seed <= 50; ++seed) {
    Rig one(6, seed);
    one.Move(4, 15);
    EXPECT_THAT(one.Find().moved, ElementsAre(4)) << "seed " << seed;
    EXPECT_THAT(one.Find().still, ElementsAre(0, 1, 2, 3, 5)) << "seed " << seed;
    Rig two(6, seed);
    two.Move(0, 20);
    two.Move(3, -25);
    EXPECT_THAT(two.Find().moved, ElementsAre(0, 3)) << "seed " << seed;
  }
}

// Two cameras on one bar that move alike are not the rig.
TEST(MovedSet, TheLargerGroupIsTheFrame) {
  Rig rig(6, 3);
  rig.Move(1, 30);
  rig.Move(2, 30);
  EXPECT_THAT(rig.Find().moved, ElementsAre(1, 2));
}

TEST(MovedSet, SaysWhereItCannotBeTold) {
  Rig halves(4, 5);
  halves.Move(2, 40);
  halves.Move(3, 40);
  EXPECT_THAT(halves.Find().problem, HasSubstr("cannot be told"));
  EXPECT_THAT(halves.Find().moved, IsEmpty());
  EXPECT_THAT(halves.Find().still, ElementsAre(0, 1, 2, 3));
  Rig pair(2, 5);
  pair.Move(1, 40);
  EXPECT_THAT(pair.Find().problem, HasSubstr("cannot be told"));
}

TEST(MovedSet, SearchesLargeRigsOneByOne) {
  Rig rig(40, 7);
  for (const int camera : {3, 17, 22, 39}) rig.Move(camera, 25);
  EXPECT_THAT(rig.Find().moved, ElementsAre(3, 17, 22, 39));
}

}  // namespace
}  // namespace rigcal::server::moved_set_test

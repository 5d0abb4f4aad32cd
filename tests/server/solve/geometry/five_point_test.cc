// SPDX-License-Identifier: Apache-2.0
#include "server/solve/geometry/five_point.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>
#include <random>
#include <vector>

namespace rigcal::server::five_point_test {
namespace {

// Five random points in front of two cameras, 1 to 4 m away.
struct Scene {
  Eigen::Matrix3d essential;
  std::vector<RayPair> pairs;
};

Scene RandomScene(std::mt19937* random) {
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto vector = [&] {
    return Eigen::Vector3d(uniform(*random), uniform(*random), uniform(*random));
  };
  Scene scene;
  while (scene.pairs.size() < 5) {
    scene.pairs.clear();
    const Eigen::Matrix3d rotation =
        Eigen::AngleAxisd(1.2 * uniform(*random), vector().normalized()).toRotationMatrix();
    const Eigen::Vector3d centre(0, 0, 2.5);
    // Camera b looks at the points too.
    const Eigen::Vector3d translation = centre - rotation * centre + 0.5 * vector();
    Eigen::Matrix3d cross;
    cross << 0, -translation.z(), translation.y(), translation.z(), 0, -translation.x(),
        -translation.y(), translation.x(), 0;
    scene.essential = (cross * rotation).normalized();
    for (int i = 0; i < 5; ++i) {
      const Eigen::Vector3d a = centre + 1.4 * vector(), b = rotation * a + translation;
      if (a.z() < 0.5 || b.z() < 0.5) break;
      scene.pairs.push_back({a.hnormalized(), b.hnormalized()});
    }
  }
  return scene;
}

double Distance(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  return std::min((a - b).norm(), (a + b).norm());
}

TEST(FivePoint, FindsTheTrueMatrix) {
  std::mt19937 random(1);
  int found = 0;
  for (int k = 0; k < 500; ++k) {
    const Scene scene = RandomScene(&random);
    const auto essentials = EssentialsOfFivePoints(scene.pairs);
    EXPECT_LE(essentials.size(), 10u);
    double nearest = std::numeric_limits<double>::infinity();
    for (const Eigen::Matrix3d& essential : essentials) {
      nearest = std::min(nearest, Distance(essential, scene.essential));
    }
    found += nearest < 1e-6 ? 1 : 0;
  }
  // A few scenes are nearly degenerate.
  EXPECT_GE(found, 495);
}

TEST(FivePoint, EverySolutionIsAnEssentialMatrixThatFits) {
  std::mt19937 random(2);
  for (int k = 0; k < 200; ++k) {
    const Scene scene = RandomScene(&random);
    for (const Eigen::Matrix3d& essential : EssentialsOfFivePoints(scene.pairs)) {
      EXPECT_NEAR(essential.norm(), 1, 1e-12);
      EXPECT_NEAR(essential.determinant(), 0, 1e-5);
      const Eigen::Matrix3d square = essential * essential.transpose();
      EXPECT_LT((2 * square * essential - square.trace() * essential).norm(), 1e-4);
      for (const RayPair& pair : scene.pairs) {
        EXPECT_NEAR(pair.b.homogeneous().dot(essential * pair.a.homogeneous()), 0, 1e-9);
      }
    }
  }
}

TEST(FivePoint, DegeneratePointsGiveNothingThatIsNotFinite) {
  const std::vector<RayPair> same(5, RayPair{{0.1, 0.2}, {0.3, -0.1}});
  for (const Eigen::Matrix3d& essential : EssentialsOfFivePoints(same)) {
    EXPECT_TRUE(essential.allFinite());
  }
  std::vector<RayPair> broken = same;
  broken[2].a.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(EssentialsOfFivePoints(broken).empty());
  EXPECT_TRUE(EssentialsOfFivePoints({same.data(), 4}).empty());
}

}  // namespace
}  // namespace rigcal::server::five_point_test

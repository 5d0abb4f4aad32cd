// SPDX-License-Identifier: Apache-2.0
#include "server/solve/geometry/triangulation.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>

namespace rigcal::server::triangulation_test {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

RigidTransform Camera(const Eigen::Vector3d& centre_m, double turn_rad = 0) {
  const Eigen::Quaterniond rotation(Eigen::AngleAxisd(turn_rad, Eigen::Vector3d::UnitY()));
  return {rotation, rotation * -centre_m};
}

CameraRay View(const RigidTransform& cam_from_rig, const Eigen::Vector3d& x_in_rig) {
  return {cam_from_rig, (cam_from_rig * x_in_rig).hnormalized()};
}

bool MeetForBoth(const CameraRay& a, const CameraRay& b) {
  const bool pair_ok = TriangulatePair(a, b).has_value();
  EXPECT_EQ(pair_ok, Triangulate({a, b}).has_value());
  return pair_ok;
}

TEST(Triangulate, FindsTheExactPoint) {
  const Eigen::Vector3d truth(0.3, -0.2, 4);
  const CameraRay a = View(Camera({0, 0, 0}), truth), b = View(Camera({2, 0.5, 0}, 0.4), truth);
  ASSERT_TRUE(MeetForBoth(a, b));
  EXPECT_LT((*TriangulatePair(a, b) - truth).norm(), 1e-10);
  EXPECT_LT((*Triangulate({a, b}) - truth).norm(), 1e-10);
}

TEST(Triangulate, MinimisesTheErrorsInTheImagesOfAllViews) {
  const Eigen::Vector3d truth(0.3, -0.2, 4);
  std::vector<CameraRay> views = {View(Camera({0, 0, 0}), truth),
                                  View(Camera({2, 0, 0}, 0.4), truth),
                                  View(Camera({-2, 1, 1}, -0.3), truth)};
  views[1].ray += Eigen::Vector2d(0.002, -0.001);
  const auto cost = [&views](const Eigen::Vector3d& point) {
    double sum = 0;
    for (const CameraRay& view : views) {
      sum += ((view.cam_from_rig * point).hnormalized() - view.ray).squaredNorm();
    }
    return sum;
  };
  const auto found = Triangulate(views);
  ASSERT_TRUE(found);
  const Eigen::Vector3d point = *found;
  EXPECT_LT((point - truth).norm(), 0.02);
  for (int axis = 0; axis < 3; ++axis) {
    for (const double step_m : {-1e-4, 1e-4}) {
      EXPECT_GT(cost(point + step_m * Eigen::Vector3d::Unit(axis)), cost(point));
    }
  }
}

TEST(Triangulate, WeighsRaysByTheirVariance) {
  const Eigen::Vector3d truth(0.3, -0.2, 4);
  std::vector<CameraRay> views = {View(Camera({0, 0, 0}), truth),
                                  View(Camera({2, 0, 0}, 0.4), truth),
                                  View(Camera({-2, 1, 1}, -0.3), truth)};
  views[1].ray += Eigen::Vector2d(0.002, -0.001);
  const double alike_m = (*Triangulate(views) - truth).norm();
  views[1].weight = 0.01;
  EXPECT_LT((*Triangulate(views) - truth).norm(), 0.05 * alike_m);
}

TEST(Triangulate, NeedsTwoViews) {
  EXPECT_FALSE(Triangulate({}));
  EXPECT_FALSE(Triangulate({View(Camera({0, 0, 0}), {0, 0, 4})}));
}

TEST(Triangulate, TwoCamerasAtOnePlaceSeeNoDepth) {
  const Eigen::Vector3d truth(0.3, -0.2, 4);
  EXPECT_FALSE(MeetForBoth(View(Camera({1, 0, 0}), truth), View(Camera({1, 0, 0}, 0.3), truth)));
  // Nor where their rays contradict each other and meet in the cameras' centre alone.
  EXPECT_FALSE(MeetForBoth(View(Camera({1, 0, 0}), truth),
                           View(Camera({1, 0, 0}, 0.3), truth + Eigen::Vector3d(0.1, 0, 0))));
}

TEST(Triangulate, APointOnTheBaselineHasNoDepth) {
  EXPECT_FALSE(MeetForBoth(View(Camera({0, 0, 0}), {0, 0, 4}), View(Camera({0, 0, 1}), {0, 0, 4})));
}

TEST(Triangulate, ParallelRaysDoNotMeet) {
  const CameraRay a{Camera({0, 0, 0}), {0.1, 0.1}}, b{Camera({1, 0, 0}), {0.1, 0.1}};
  EXPECT_FALSE(MeetForBoth(a, b));
}

TEST(Triangulate, RefusesAPointBehindACamera) {
  // The rays diverge before the cameras: what meets lies behind both.
  const Eigen::Vector3d behind(0.5, 0, -3);
  EXPECT_FALSE(MeetForBoth(View(Camera({0, 0, 0}), behind), View(Camera({1, 0, 0}), behind)));
  // Before one and behind the other.
  const Eigen::Vector3d between(0.3, 0.2, 4);
  EXPECT_FALSE(MeetForBoth(View(Camera({0, 0, 0}), between), View(Camera({1, 0, 8}), between)));
  EXPECT_FALSE(Triangulate({View(Camera({0, 0, 0}), between), View(Camera({1, 0, 0}), between),
                            View(Camera({1, 0, 8}), between)}));
}

TEST(Triangulate, RefusesWhatIsNotFinite) {
  const Eigen::Vector3d truth(0.3, -0.2, 4);
  const CameraRay a = View(Camera({0, 0, 0}), truth), b = View(Camera({2, 0, 0}), truth);
  const CameraRay c = View(Camera({0, 2, 0}), truth);
  for (const double bad : {kNaN, std::numeric_limits<double>::infinity()}) {
    CameraRay broken = c;
    broken.ray.x() = bad;
    EXPECT_FALSE(TriangulatePair(a, broken));
    EXPECT_FALSE(TriangulatePair(broken, a));
    EXPECT_FALSE(Triangulate({a, b, broken}));
    EXPECT_FALSE(Triangulate({broken, a, b}));
    broken = c;
    broken.cam_from_rig.translation_m.y() = bad;
    EXPECT_FALSE(TriangulatePair(a, broken));
    EXPECT_FALSE(Triangulate({a, b, broken}));
  }
}

TEST(TriangulateWithoutEach, IsWhatTheOtherViewsSay) {
  const Eigen::Vector3d truth(0.3, -0.2, 4);
  for (const int count : {2, 3, 4, 5, 9}) {
    std::vector<CameraRay> views;
    for (int i = 0; i < count; ++i) {
      views.push_back(View(Camera({0.6 * i - 2, 0.3 * (i % 3), 0.2 * (i % 2)}), truth));
      views.back().ray += 1e-3 * Eigen::Vector2d(std::sin(3 * i), std::cos(5 * i));
    }
    const auto points = TriangulateWithoutEach(views);
    ASSERT_EQ(points.size(), views.size());
    for (size_t i = 0; i < views.size(); ++i) {
      std::vector<CameraRay> others = views;
      others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
      const auto expected = Triangulate(others);
      ASSERT_EQ(points[i].has_value(), expected.has_value()) << count;
      if (expected) {
        EXPECT_LT((*points[i] - *expected).norm(), 2e-5) << count;
        EXPECT_NE(RayError(views[i], *points[i]), 0);
      }
    }
  }
}

// Beyond what is linear: as if it had been left out from the start.
TEST(TriangulateWithoutEach, AViewFarOffDoesNotSpoilItsOwnPoint) {
  const Eigen::Vector3d truth(0.3, -0.2, 4);
  std::vector<CameraRay> views;
  for (int i = 0; i < 6; ++i) views.push_back(View(Camera({0.6 * i - 2, 0.1 * i, 0}), truth));
  views[2].ray += Eigen::Vector2d(0.2, -0.1);
  const auto points = TriangulateWithoutEach(views);
  ASSERT_TRUE(points[2]);
  EXPECT_LT((*points[2] - truth).norm(), 1e-9);
}

}  // namespace
}  // namespace rigcal::server::triangulation_test

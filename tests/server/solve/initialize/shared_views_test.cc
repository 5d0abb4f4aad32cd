// SPDX-License-Identifier: Apache-2.0
#include "server/solve/initialize/shared_views.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace rigcal::server::shared_views_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

// Cameras of 1000 px focal length with their centre at (640, 512).
BundleProblem Cameras(const std::vector<std::string>& names) {
  BundleProblem problem;
  for (const std::string& name : names) {
    BundleCamera camera;
    camera.name = name;
    camera.intrinsics = IntrinsicsVector::Zero(9);
    camera.intrinsics.head<4>() << 1000, 1000, 640, 512;
    problem.cameras.push_back(camera);
  }
  return problem;
}

void Add(const std::vector<std::pair<int, Eigen::Vector2d>>& views, BundleProblem* problem) {
  BundleInstant instant;
  instant.first_observation = static_cast<int>(problem->observations.size());
  instant.observation_count = static_cast<int>(views.size());
  for (const auto& [camera, centre_px] : views) {
    problem->observations.push_back({camera, 0, 0, static_cast<int>(problem->markers.size()), 1});
    BundleMarker marker;
    marker.centre_px = centre_px;
    problem->markers.push_back(marker);
  }
  problem->instants.push_back(instant);
}

TEST(DescribeSharedViews, SaysWhereInBothImages) {
  BundleProblem problem = Cameras({"a", "b", "c"});
  for (int i = 0; i < 101; ++i) {
    Add({{0, {100 + i, 512}}, {1, {1200, 900 + i}}}, &problem);
    Add({{0, {640, 20}}, {2, {640, 512}}}, &problem);  // another pair's
  }
  const std::string text = DescribeSharedViews(problem, 0, 1);
  EXPECT_THAT(text, AllOf(HasSubstr("the left of a's image (4 x 0 degrees)"),
                          HasSubstr("the lower right of b's image (0 x 4 degrees)")));
  EXPECT_THAT(DescribeSharedViews(problem, 0, 2),
              AllOf(HasSubstr("the upper part of a's"), HasSubstr("the middle of c's")));
}

TEST(DescribeSharedViews, IsEmptyWhereNothingIsShared) {
  BundleProblem problem = Cameras({"a", "b", "c"});
  EXPECT_EQ(DescribeSharedViews(problem, 0, 1), "");
  Add({{0, {100, 100}}, {2, {100, 100}}}, &problem);
  EXPECT_EQ(DescribeSharedViews(problem, 0, 1), "");
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  Add({{0, {kNaN, 1}}, {1, {1, 1}}}, &problem);
  EXPECT_EQ(DescribeSharedViews(problem, 0, 1), "");
}

TEST(DescribeLostCameras, NamesTheCameraItsPartnerAndTheCounts) {
  BundleProblem problem = Cameras({"a", "b", "c"});
  for (int i = 0; i < 30; ++i) {
    Add({{0, {100, 100}}, {1, {100, 100}}, {2, {1200, 100}}}, &problem);
    if (i >= 3) problem.markers.back().used = false;
  }
  for (int i = 0; i < 5; ++i) Add({{1, {100, 100}}, {2, {1200, 100}}}, &problem);
  for (int i = 0; i < 5; ++i) problem.instants[static_cast<size_t>(30 + i)].used = false;
  EXPECT_THAT(
      DescribeLostCameras(problem, 8),
      AllOf(HasSubstr("camera c: of the 35 wand views that it shares with others 3 agree"),
            HasSubstr("shares most with b (35; both saw it in the upper right of c's image"),
            Not(HasSubstr("camera a:")), Not(HasSubstr("camera b:"))));
  EXPECT_EQ(DescribeLostCameras(problem, 3), "");
}

TEST(DescribeNearestViews, NamesTheTwoAndHowFarApartTheyAre) {
  std::vector<AlignedTrack> tracks(3);
  for (size_t t = 0; t < tracks.size(); ++t) {
    tracks[t].track.session_id = "s";
    tracks[t].track.camera.camera = std::string(1, static_cast<char>('a' + t));
    for (int i = 0; i < 2; ++i) {
      Observation observation;
      observation.markers.resize(1);
      observation.markers[0].visible = t != 1 || i == 0;
      tracks[t].track.observations.push_back(observation);
    }
  }
  constexpr int64_t kS = 1'000'000'000;
  // b's second view shows nothing.
  EXPECT_THAT(DescribeNearestViews(tracks, {{0, 1 * kS}, {40 * kS, 6 * kS}, {9 * kS, 5 * kS}}),
              HasSubstr("cameras a and c come nearest to it: their closest wand views are 4 s"));
  tracks[2].track.session_id = "another";
  EXPECT_THAT(DescribeNearestViews(tracks, {{0, 1 * kS}, {40 * kS, 6 * kS}, {9 * kS, 5 * kS}}),
              HasSubstr("cameras a and b come nearest to it: their closest wand views are 39 s"));
  EXPECT_EQ(DescribeNearestViews({}, {}), "");
}

}  // namespace
}  // namespace rigcal::server::shared_views_test

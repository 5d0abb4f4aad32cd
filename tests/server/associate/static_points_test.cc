// SPDX-License-Identifier: Apache-2.0
#include "server/associate/static_points.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"

namespace rigcal::server::static_points_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr int64_t kSecondNs = 1'000'000'000;

Target Points(int count, bool is_surveyed = false) {
  Target target;
  target.kind = TargetKind::kStatic;
  target.is_surveyed = is_surveyed;
  for (int i = 0; i < count; ++i) {
    target.points.push_back({absl::StrCat("p", i), 0.1 * i, 0.1 * i * i, 0, 0.001});
  }
  return target;
}

MarkerObservation Centre(double x_px, double y_px, double variance_px2 = 0.09) {
  MarkerObservation marker;
  marker.visible = true;
  marker.centre_px = {x_px, y_px};
  marker.covariance_px2 = variance_px2 * Eigen::Matrix2d::Identity();
  return marker;
}

CleanTrack TrackOf(const std::string& camera, const std::vector<Observation>& rows) {
  CleanTrack track;
  track.session_id = "room";
  track.camera.camera = camera;
  track.observations = rows;
  return track;
}

std::vector<AlignedTrack> Gather(const std::vector<CleanTrack>& tracks, const Target& target,
                                 RefusalCounter* refused) {
  AlignedTrack moving;
  moving.track.observations =
      std::vector<Observation>{{5 * kSecondNs, 0, {}}, {35 * kSecondNs, 0, {}}};
  return GatherStaticPoints(
      tracks, [&target](const std::string&) -> const Target& { return target; }, {moving}, refused);
}

TEST(GatherStaticPoints, MakesOneCentreOfAllRows) {
  std::vector<Observation> rows;
  for (int i = 0; i < 16; ++i) {
    const double off_px = i % 2 == 0 ? 0.1 : -0.1;
    rows.push_back({i * kSecondNs, 0, {Centre(100 + off_px, 50 - off_px), {}, Centre(7, 8)}});
  }
  RefusalCounter refused;
  const auto tracks = Gather({TrackOf("a", rows)}, Points(3), &refused);
  ASSERT_THAT(tracks, SizeIs(1));
  EXPECT_TRUE(tracks[0].is_static);
  EXPECT_THAT(tracks[0].static_points, ElementsAre(0, 2));
  const ObservationTable& table = tracks[0].track.observations;
  ASSERT_EQ(table.size(), 2u);
  EXPECT_NEAR(table.centre_px(0, 0).x(), 100, 1e-9);
  EXPECT_NEAR(table.centre_px(0, 0).y(), 50, 1e-9);
  EXPECT_NEAR(table.covariance_px2(0, 0)(0, 0), 0.09 / 16, 1e-9);
  EXPECT_THAT(refused.List(), IsEmpty());
}

// Thousands of rows of one point are no independent evidence of where it is.
TEST(GatherStaticPoints, NoCentreStandsForMoreThanSomeRows) {
  std::vector<Observation> rows;
  for (int i = 0; i < 5000; ++i) rows.push_back({i * kSecondNs, 0, {Centre(100, 50)}});
  RefusalCounter refused;
  const auto tracks = Gather({TrackOf("a", rows)}, Points(1), &refused);
  ASSERT_THAT(tracks, SizeIs(1));
  EXPECT_NEAR(tracks[0].track.observations.covariance_px2(0, 0)(1, 1), 0.09 / kMaxRowsOfCentre,
              1e-9);
}

TEST(GatherStaticPoints, RowsThatScatterMoreThanStatedCountByTheirScatter) {
  std::vector<Observation> rows;
  for (int i = 0; i < 16; ++i) {
    rows.push_back({i * kSecondNs, 0, {Centre(100 + (i % 2 == 0 ? 1 : -1), 50)}});
  }
  RefusalCounter refused;
  const auto tracks = Gather({TrackOf("a", rows)}, Points(1), &refused);
  ASSERT_THAT(tracks, SizeIs(1));
  const Eigen::Matrix2d covariance_px2 = tracks[0].track.observations.covariance_px2(0, 0);
  EXPECT_NEAR(covariance_px2.trace(), 16.0 / 15 / 16, 1e-9);
}

TEST(GatherStaticPoints, CountsOutliersAndPointsThatMoved) {
  std::vector<Observation> rows;
  for (int i = 0; i < 12; ++i) {
    rows.push_back({i * kSecondNs, 0, {Centre(i == 3 ? 400 : 100, 50), Centre(20.0 * i, 70)}});
  }
  RefusalCounter refused;
  const auto tracks = Gather({TrackOf("a", rows)}, Points(2), &refused);
  ASSERT_THAT(tracks, SizeIs(1));
  EXPECT_THAT(tracks[0].static_points, ElementsAre(0));
  EXPECT_NEAR(tracks[0].track.observations.centre_px(0, 0).x(), 100, 1e-9);
  ASSERT_THAT(refused.List(), SizeIs(1));
  EXPECT_EQ(refused.List()[0].reason, RefusalReason::kOutlier);
  EXPECT_EQ(refused.List()[0].count, 13u);
  EXPECT_THAT(refused.List()[0].example, HasSubstr("static point p0"));
}

TEST(GatherStaticPoints, GivesAPointOneTimeInEveryCamera) {
  const std::vector<Observation> left = {{0, 0, {Centre(1, 2), Centre(3, 4), Centre(5, 6)}}};
  const std::vector<Observation> right = {{77, 0, {{}, Centre(30, 40), Centre(50, 60)}}};
  RefusalCounter refused;
  const auto tracks = Gather({TrackOf("a", left), TrackOf("b", right)}, Points(3), &refused);
  ASSERT_THAT(tracks, SizeIs(2));
  const auto times = CoarseRigTimes(tracks);
  EXPECT_THAT(times[0], ElementsAre(10 * kSecondNs, 20 * kSecondNs, 30 * kSecondNs));
  EXPECT_THAT(times[1], ElementsAre(20 * kSecondNs, 30 * kSecondNs));
}

// Of all epochs of a camera's clock.
TEST(GatherStaticPoints, SurveyedPointsAreOneRow) {
  CleanTrack before = TrackOf("a", {{0, 0, {Centre(1, 2), {}, Centre(5, 6), {}}}});
  CleanTrack after = TrackOf("a", {{9, 0, {{}, {}, Centre(5, 8), Centre(7, 9)}}});
  after.clock_epoch = 1;
  RefusalCounter refused;
  const auto tracks = Gather({before, after}, Points(4, true), &refused);
  ASSERT_THAT(tracks, SizeIs(1));
  EXPECT_THAT(tracks[0].static_points, IsEmpty());
  const ObservationTable& table = tracks[0].track.observations;
  ASSERT_EQ(table.size(), 1u);
  EXPECT_EQ(table.time_ns(0), 20 * kSecondNs);
  EXPECT_EQ(table.VisibleCount(0), 3);
  EXPECT_NEAR(table.centre_px(0, 2).y(), 7, 1e-9);
}

TEST(GatherStaticPoints, ACameraWithoutPointsHasNoTrack) {
  RefusalCounter refused;
  EXPECT_THAT(Gather({TrackOf("a", {{0, 0, {{}, {}}}})}, Points(2), &refused), IsEmpty());
}

}  // namespace
}  // namespace rigcal::server::static_points_test

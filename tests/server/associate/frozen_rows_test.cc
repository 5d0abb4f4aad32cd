// SPDX-License-Identifier: Apache-2.0
#include "server/associate/frozen_rows.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

namespace rigcal::server::frozen_rows_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr int64_t kPeriodNs = 40'000'000;
constexpr int kRows = 200;

// A marker on a circle of `radius_px`.
CameraTrack TrackOf(const std::string& camera, double radius_px) {
  CameraTrack track;
  track.session_id = "s";
  track.camera.camera = camera;
  track.camera.image_size_px = {1280, 1024};
  for (int i = 0; i < kRows; ++i) {
    Observation row;
    row.time_ns = i * kPeriodNs;
    row.markers.resize(1);
    row.markers[0].visible = true;
    row.markers[0].centre_px = {640 + radius_px * std::cos(0.1 * i),
                                512 + radius_px * std::sin(0.1 * i)};
    track.observations.push_back(row);
  }
  return track;
}

// From row `from` on it shows that row again.
CameraTrack FrozenTrack(const std::string& camera, size_t from) {
  CameraTrack track = TrackOf(camera, 200);
  for (size_t i = from; i < track.observations.size(); ++i) {
    track.observations[i].markers = track.observations[from].markers;
  }
  return track;
}

std::vector<StampFault> Take(std::vector<CameraTrack>* tracks, RefusalCounter* refused,
                             TargetKind kind = TargetKind::kWand) {
  Target target;
  target.kind = kind;
  return TakeFrozenRows([&target](const std::string&) -> const Target& { return target; }, tracks,
                        refused);
}

TEST(TakeFrozenRows, OfAnImageThatStopsTheFirstRowStays) {
  std::vector<CameraTrack> tracks = {TrackOf("a", 200), FrozenTrack("b", 100), TrackOf("c", 200)};
  RefusalCounter refused;
  const std::vector<StampFault> faults = Take(&tracks, &refused);
  ASSERT_THAT(faults, SizeIs(1));
  EXPECT_EQ(faults[0].kind, StampFault::Kind::kFrozen);
  EXPECT_EQ(faults[0].camera, "b");
  EXPECT_EQ(faults[0].size, 50);
  EXPECT_THAT(faults[0].what,
              AllOf(HasSubstr("100 of its 200 wand views"), HasSubstr("second 4.0")));
  EXPECT_THAT(tracks[0].observations, SizeIs(kRows));
  EXPECT_THAT(tracks[1].observations, SizeIs(101));
  EXPECT_THAT(tracks[2].observations, SizeIs(kRows));
  ASSERT_THAT(refused.List(), SizeIs(1));
  EXPECT_EQ(refused.List()[0].reason, RefusalReason::kDuplicateEqual);
  EXPECT_EQ(refused.List()[0].count, 99u);
}

TEST(TakeFrozenRows, ATargetAtRestIsNotFrozen) {
  std::vector<CameraTrack> tracks = {TrackOf("a", 0), TrackOf("b", 0), TrackOf("c", 0)};
  RefusalCounter refused;
  EXPECT_THAT(Take(&tracks, &refused), IsEmpty());
  for (const CameraTrack& track : tracks) EXPECT_THAT(track.observations, SizeIs(kRows));
}

TEST(TakeFrozenRows, WhereNoOtherCameraSeesTheTargetNothingIsSaid) {
  std::vector<CameraTrack> tracks = {TrackOf("a", 200), FrozenTrack("b", 100)};
  for (Observation& row : tracks[0].observations) {
    if (row.time_ns > 90 * kPeriodNs) row.markers[0].visible = false;
  }
  RefusalCounter refused;
  EXPECT_THAT(Take(&tracks, &refused), IsEmpty());
  EXPECT_THAT(tracks[1].observations, SizeIs(kRows));
}

TEST(TakeFrozenRows, AFewEqualRowsStay) {
  std::vector<CameraTrack> tracks = {TrackOf("a", 200), FrozenTrack("b", kRows - 15)};
  RefusalCounter refused;
  EXPECT_THAT(Take(&tracks, &refused), IsEmpty());
  EXPECT_TRUE(refused.empty());
}

TEST(TakeFrozenRows, StaticPointsAreLeftAlone) {
  std::vector<CameraTrack> tracks = {TrackOf("a", 200), FrozenTrack("b", 100)};
  RefusalCounter refused;
  EXPECT_THAT(Take(&tracks, &refused, TargetKind::kStatic), IsEmpty());
}

TEST(TakeFrozenRows, RowsWithoutAMarkerAreNoImage) {
  std::vector<CameraTrack> tracks = {TrackOf("a", 200), TrackOf("b", 200)};
  for (size_t i = 50; i < kRows; ++i) tracks[1].observations[i].markers[0].visible = false;
  RefusalCounter refused;
  EXPECT_THAT(Take(&tracks, &refused), IsEmpty());
  std::vector<CameraTrack> none;
  EXPECT_THAT(Take(&none, &refused), IsEmpty());
}

}  // namespace
}  // namespace rigcal::server::frozen_rows_test

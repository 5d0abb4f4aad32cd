// SPDX-License-Identifier: Apache-2.0
#include "server/associate/repeated_rows.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>
#include <vector>

namespace rigcal::server::repeated_rows_test {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr int64_t kPeriodNs = 40'000'000;
constexpr int kRows = 200;

// Two markers at pixels that no other seed has.
CameraTrack TrackOf(const std::string& camera, int seed) {
  CameraTrack track;
  track.session_id = "s";
  track.camera.camera = camera;
  std::mt19937 random(static_cast<unsigned>(seed));
  std::uniform_real_distribution<double> at_px(0, 1000);
  for (int i = 0; i < kRows; ++i) {
    Observation row;
    row.time_ns = i * kPeriodNs;
    row.markers.resize(2);
    for (MarkerObservation& marker : row.markers) {
      marker.visible = i % 10 != 9;
      marker.centre_px = {at_px(random), at_px(random)};
    }
    track.observations.push_back(row);
  }
  return track;
}

CameraTrack Named(CameraTrack track, const std::string& camera) {
  track.camera.camera = camera;
  return track;
}

uint64_t Count(const RefusalCounter& refused) {
  uint64_t count = 0;
  for (const Refusal& refusal : refused.List()) {
    EXPECT_EQ(refusal.reason, RefusalReason::kDuplicateEqual);
    count += refusal.count;
  }
  return count;
}

TEST(UseRepeatedRowsOnce, AFileThatWasAppendedToItselfIsUsedOnce) {
  CameraTrack track = TrackOf("a", 1);
  const std::vector<Observation> once = track.observations;
  for (Observation row : once) {
    row.clock_epoch = 1;  // as agents begin one where stamps go back
    track.observations.push_back(row);
  }
  std::vector<CameraTrack> tracks = {track, TrackOf("b", 2)};
  RefusalCounter refused;
  const std::vector<StampFault> faults = UseRepeatedRowsOnce(&tracks, &refused);
  ASSERT_THAT(faults, SizeIs(1));
  EXPECT_EQ(faults[0].kind, StampFault::Kind::kTwice);
  EXPECT_EQ(faults[0].camera, "a");
  EXPECT_EQ(faults[0].size, kRows);
  EXPECT_THAT(faults[0].what, HasSubstr("200 of its 400 rows"));
  EXPECT_EQ(Count(refused), uint64_t{kRows});
  ASSERT_THAT(tracks[0].observations, SizeIs(kRows));
  for (const Observation& row : tracks[0].observations) EXPECT_EQ(row.clock_epoch, 0u);
  EXPECT_THAT(tracks[1].observations, SizeIs(kRows));
}

TEST(UseRepeatedRowsOnce, RowsThatAreDoubledInPlaceAreUsedOnce) {
  CameraTrack track = TrackOf("a", 1);
  std::vector<Observation> doubled;
  for (const Observation& row : track.observations) doubled.insert(doubled.end(), 2, row);
  track.observations = doubled;
  std::vector<CameraTrack> tracks = {track};
  RefusalCounter refused;
  EXPECT_THAT(UseRepeatedRowsOnce(&tracks, &refused), SizeIs(1));
  EXPECT_THAT(tracks[0].observations, SizeIs(kRows));
}

TEST(UseRepeatedRowsOnce, AFewAreCountedAndNotNamed) {
  CameraTrack track = TrackOf("a", 1);
  for (size_t i = 0; i < 5; ++i) track.observations.push_back(track.observations[i]);
  std::vector<CameraTrack> tracks = {track};
  RefusalCounter refused;
  EXPECT_THAT(UseRepeatedRowsOnce(&tracks, &refused), IsEmpty());
  EXPECT_EQ(Count(refused), 5u);
}

TEST(UseRepeatedRowsOnce, OtherRowsAtTheSameStampsStay) {
  CameraTrack track = TrackOf("a", 1);
  const CameraTrack other = TrackOf("a", 2);
  track.observations.insert(track.observations.end(), other.observations.begin(),
                            other.observations.end());
  std::vector<CameraTrack> tracks = {track};
  RefusalCounter refused;
  EXPECT_THAT(UseRepeatedRowsOnce(&tracks, &refused), IsEmpty());
  EXPECT_THAT(tracks[0].observations, SizeIs(2 * kRows));
  EXPECT_TRUE(refused.empty());
}

TEST(FindCopiedRows, OneCamerasFileUnderAnothersNameIsNamed) {
  const CameraTrack a = TrackOf("a", 1);
  const std::vector<StampFault> faults = FindCopiedRows({a, TrackOf("b", 2), Named(a, "c")});
  ASSERT_THAT(faults, SizeIs(1));
  EXPECT_EQ(faults[0].kind, StampFault::Kind::kCopied);
  EXPECT_EQ(faults[0].camera, "c");
  EXPECT_EQ(faults[0].size, 100);
  EXPECT_THAT(faults[0].what, HasSubstr("the same rows as a: 180 of its 180 wand views"));
  EXPECT_THAT(faults[0].what, HasSubstr("at the same times"));
}

TEST(FindCopiedRows, ACopyWithAnotherClockOrAPartOfOneIsNamed) {
  CameraTrack copy = Named(TrackOf("a", 1), "b");
  const CameraTrack own = TrackOf("b", 2);
  for (size_t i = 0; i < copy.observations.size(); ++i) {
    if (i % 3 != 0) copy.observations[i] = own.observations[i];
    copy.observations[i].time_ns += 500'000'000;
  }
  const std::vector<StampFault> faults = FindCopiedRows({TrackOf("a", 1), copy});
  ASSERT_THAT(faults, SizeIs(1));
  EXPECT_THAT(faults[0].what, HasSubstr("the same rows as a: 60 of its 180 wand views"));
  EXPECT_THAT(faults[0].what, HasSubstr("0.5 s later"));
}

TEST(FindCopiedRows, SoundCamerasAreNotNamed) {
  EXPECT_THAT(FindCopiedRows({TrackOf("a", 1), TrackOf("b", 2), TrackOf("c", 3)}), IsEmpty());
  EXPECT_THAT(FindCopiedRows({}), IsEmpty());
  // The same camera in another session is no other camera.
  CameraTrack later = TrackOf("a", 1);
  later.session_id = "t";
  EXPECT_THAT(FindCopiedRows({TrackOf("a", 1), later}), IsEmpty());
}

TEST(FindCopiedRows, ATargetAtRestAndAHandfulOfEqualRowsSayNothing) {
  CameraTrack a = TrackOf("a", 1), b = TrackOf("b", 2);
  for (size_t i = 0; i < 15; ++i) b.observations[i] = a.observations[i];
  EXPECT_THAT(FindCopiedRows({a, b}), IsEmpty());
  for (CameraTrack* track : {&a, &b}) {
    for (Observation& row : track->observations) {
      for (MarkerObservation& marker : row.markers) marker.centre_px = {320, 240};
    }
  }
  EXPECT_THAT(FindCopiedRows({a, b}), IsEmpty());
}

// Whole pixels of one marker meet by chance in long recordings, at any distance in time.
TEST(FindCopiedRows, PixelsThatMeetByChanceAreNoCopy) {
  std::vector<CameraTrack> tracks = {TrackOf("a", 1), TrackOf("b", 2)};
  for (CameraTrack& track : tracks) {
    for (Observation& row : track.observations) {
      row.markers.resize(1);
      for (double& value_px : row.markers[0].centre_px) value_px = std::floor(value_px / 50);
    }
  }
  EXPECT_THAT(FindCopiedRows(tracks), IsEmpty());
}

}  // namespace
}  // namespace rigcal::server::repeated_rows_test

// SPDX-License-Identifier: Apache-2.0
#include "server/associate/copied_rows.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "tests/server/associate/random_track.h"

namespace rigcal::server::copied_rows_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

bool NoneIsNeeded(const std::string&) { return false; }

CameraTrack Named(CameraTrack track, const std::string& camera) {
  track.camera.camera = camera;
  return track;
}

std::vector<StampFault> Use(std::vector<CameraTrack>* tracks) {
  RefusalCounter refused;
  return UseCopiedRowsOnce(NoneIsNeeded, tracks, &refused);
}

TEST(UseCopiedRowsOnce, OfAFileUnderTwoNamesOneCameraIsLeft) {
  const CameraTrack a = RandomTrack("a", 1);
  std::vector<CameraTrack> tracks = {a, RandomTrack("b", 2), Named(a, "c")};
  RefusalCounter refused;
  const std::vector<StampFault> faults = UseCopiedRowsOnce(NoneIsNeeded, &tracks, &refused);
  ASSERT_THAT(faults, SizeIs(1));
  EXPECT_EQ(faults[0].kind, StampFault::Kind::kCopied);
  EXPECT_EQ(faults[0].camera, "c");
  EXPECT_EQ(faults[0].size, 100);
  EXPECT_THAT(faults[0].what, AllOf(HasSubstr("the same rows as a: 180 of its 180 wand views"),
                                    HasSubstr("at the same times"), HasSubstr("was left out")));
  EXPECT_THAT(tracks[0].observations, SizeIs(kRandomTrackRows));
  EXPECT_THAT(tracks[1].observations, SizeIs(kRandomTrackRows));
  EXPECT_THAT(tracks[2].observations, IsEmpty());
  ASSERT_THAT(refused.List(), SizeIs(1));
  EXPECT_EQ(refused.List()[0].camera, "c");
  EXPECT_EQ(refused.List()[0].count, uint64_t{kRandomTrackRows});
}

TEST(UseCopiedRowsOnce, TheCameraThatTheOptionsNameStays) {
  const CameraTrack a = RandomTrack("a", 1);
  std::vector<CameraTrack> tracks = {a, Named(a, "b")};
  RefusalCounter refused;
  const std::vector<StampFault> faults =
      UseCopiedRowsOnce([](const std::string& camera) { return camera == "b"; }, &tracks, &refused);
  ASSERT_THAT(faults, SizeIs(1));
  EXPECT_EQ(faults[0].camera, "a");
  EXPECT_THAT(tracks[0].observations, IsEmpty());
  EXPECT_THAT(tracks[1].observations, SizeIs(kRandomTrackRows));
}

// Sixty rows of each are the other's, half a second later.
TEST(UseCopiedRowsOnce, RowsThatTwoFilesShareAreTakenFromBoth) {
  CameraTrack copy = Named(RandomTrack("a", 1), "b");
  const CameraTrack own = RandomTrack("b", 2);
  for (size_t i = 0; i < copy.observations.size(); ++i) {
    if (i % 3 != 0) copy.observations[i] = own.observations[i];
    copy.observations[i].time_ns += 500'000'000;
  }
  std::vector<CameraTrack> tracks = {RandomTrack("a", 1), copy};
  const std::vector<StampFault> faults = Use(&tracks);
  ASSERT_THAT(faults, SizeIs(1));
  EXPECT_NEAR(faults[0].size, 100.0 / 3, 1e-9);
  EXPECT_THAT(faults[0].what, AllOf(HasSubstr("the same rows as a: 60 of its 180 wand views"),
                                    HasSubstr("0.5 s later"), HasSubstr("left out of both")));
  EXPECT_THAT(tracks[0].observations, SizeIs(kRandomTrackRows - 60));
  EXPECT_THAT(tracks[1].observations, SizeIs(kRandomTrackRows - 60));
}

// All rows of a are a part of b's file, which has others as well.
TEST(UseCopiedRowsOnce, TheCameraWithNothingOfItsOwnGoes) {
  CameraTrack merged = Named(RandomTrack("a", 1), "b");
  for (Observation row : RandomTrack("b", 2).observations) {
    row.time_ns += kRandomTrackRows * kRandomTrackPeriodNs;
    merged.observations.push_back(row);
  }
  std::vector<CameraTrack> tracks = {RandomTrack("a", 1), merged};
  const std::vector<StampFault> faults = Use(&tracks);
  ASSERT_THAT(faults, SizeIs(1));
  EXPECT_EQ(faults[0].camera, "a");
  EXPECT_THAT(tracks[0].observations, IsEmpty());
  EXPECT_THAT(tracks[1].observations, SizeIs(2 * kRandomTrackRows));
}

TEST(UseCopiedRowsOnce, OfThreeCopiesOneIsLeft) {
  const CameraTrack a = RandomTrack("a", 1);
  std::vector<CameraTrack> tracks = {a, Named(a, "b"), Named(a, "c")};
  EXPECT_THAT(Use(&tracks), SizeIs(2));
  EXPECT_THAT(tracks[0].observations, SizeIs(kRandomTrackRows));
  EXPECT_THAT(tracks[1].observations, IsEmpty());
  EXPECT_THAT(tracks[2].observations, IsEmpty());
}

TEST(UseCopiedRowsOnce, SoundCamerasKeepTheirRows) {
  std::vector<CameraTrack> tracks = {RandomTrack("a", 1), RandomTrack("b", 2), RandomTrack("c", 3)};
  EXPECT_THAT(Use(&tracks), IsEmpty());
  for (const CameraTrack& track : tracks) EXPECT_THAT(track.observations, SizeIs(kRandomTrackRows));
  std::vector<CameraTrack> none;
  EXPECT_THAT(Use(&none), IsEmpty());
  // The same camera in another session is no other camera.
  CameraTrack later = RandomTrack("a", 1);
  later.session_id = "t";
  std::vector<CameraTrack> sessions = {RandomTrack("a", 1), later};
  EXPECT_THAT(Use(&sessions), IsEmpty());
}

TEST(UseCopiedRowsOnce, ATargetAtRestAndAHandfulOfEqualRowsSayNothing) {
  CameraTrack a = RandomTrack("a", 1), b = RandomTrack("b", 2);
  for (size_t i = 0; i < 15; ++i) b.observations[i] = a.observations[i];
  std::vector<CameraTrack> few = {a, b};
  EXPECT_THAT(Use(&few), IsEmpty());
  for (CameraTrack* track : {&a, &b}) {
    for (Observation& row : track->observations) {
      for (MarkerObservation& marker : row.markers) marker.centre_px = {320, 240};
    }
  }
  std::vector<CameraTrack> at_rest = {a, b};
  EXPECT_THAT(Use(&at_rest), IsEmpty());
}

// Whole pixels of one marker meet by chance in long recordings, at any distance in time.
TEST(UseCopiedRowsOnce, PixelsThatMeetByChanceAreNoCopy) {
  std::vector<CameraTrack> tracks = {RandomTrack("a", 1), RandomTrack("b", 2)};
  for (CameraTrack& track : tracks) {
    for (Observation& row : track.observations) {
      row.markers.resize(1);
      for (double& value_px : row.markers[0].centre_px) value_px = std::floor(value_px / 50);
    }
  }
  EXPECT_THAT(Use(&tracks), IsEmpty());
}

}  // namespace
}  // namespace rigcal::server::copied_rows_test

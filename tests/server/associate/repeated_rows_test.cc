// SPDX-License-Identifier: Apache-2.0
#include "server/associate/repeated_rows.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/server/associate/random_track.h"

namespace rigcal::server::repeated_rows_test {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

uint64_t Count(const RefusalCounter& refused) {
  uint64_t count = 0;
  for (const Refusal& refusal : refused.List()) {
    EXPECT_EQ(refusal.reason, RefusalReason::kDuplicateEqual);
    count += refusal.count;
  }
  return count;
}

TEST(UseRepeatedRowsOnce, AFileThatWasAppendedToItselfIsUsedOnce) {
  CameraTrack track = RandomTrack("a", 1);
  const std::vector<Observation> once = track.observations;
  for (Observation row : once) {
    row.clock_epoch = 1;  // as agents begin one where stamps go back
    track.observations.push_back(row);
  }
  std::vector<CameraTrack> tracks = {track, RandomTrack("b", 2)};
  RefusalCounter refused;
  const std::vector<StampFault> faults = UseRepeatedRowsOnce(&tracks, &refused);
  ASSERT_THAT(faults, SizeIs(1));
  EXPECT_EQ(faults[0].kind, StampFault::Kind::kTwice);
  EXPECT_EQ(faults[0].camera, "a");
  EXPECT_EQ(faults[0].size, kRandomTrackRows);
  EXPECT_THAT(faults[0].what, HasSubstr("200 of its 400 rows"));
  EXPECT_EQ(Count(refused), uint64_t{kRandomTrackRows});
  ASSERT_THAT(tracks[0].observations, SizeIs(kRandomTrackRows));
  for (const Observation& row : tracks[0].observations) EXPECT_EQ(row.clock_epoch, 0u);
  EXPECT_THAT(tracks[1].observations, SizeIs(kRandomTrackRows));
}

TEST(UseRepeatedRowsOnce, RowsThatAreDoubledInPlaceAreUsedOnce) {
  CameraTrack track = RandomTrack("a", 1);
  std::vector<Observation> doubled;
  for (const Observation& row : track.observations) doubled.insert(doubled.end(), 2, row);
  track.observations = doubled;
  std::vector<CameraTrack> tracks = {track};
  RefusalCounter refused;
  EXPECT_THAT(UseRepeatedRowsOnce(&tracks, &refused), SizeIs(1));
  EXPECT_THAT(tracks[0].observations, SizeIs(kRandomTrackRows));
}

TEST(UseRepeatedRowsOnce, AFewAreCountedAndNotNamed) {
  CameraTrack track = RandomTrack("a", 1);
  for (size_t i = 0; i < 5; ++i) track.observations.push_back(track.observations[i]);
  std::vector<CameraTrack> tracks = {track};
  RefusalCounter refused;
  EXPECT_THAT(UseRepeatedRowsOnce(&tracks, &refused), IsEmpty());
  EXPECT_EQ(Count(refused), 5u);
}

TEST(UseRepeatedRowsOnce, OtherRowsAtTheSameStampsStay) {
  CameraTrack track = RandomTrack("a", 1);
  const CameraTrack other = RandomTrack("a", 2);
  track.observations.insert(track.observations.end(), other.observations.begin(),
                            other.observations.end());
  std::vector<CameraTrack> tracks = {track};
  RefusalCounter refused;
  EXPECT_THAT(UseRepeatedRowsOnce(&tracks, &refused), IsEmpty());
  EXPECT_THAT(tracks[0].observations, SizeIs(2 * kRandomTrackRows));
  EXPECT_TRUE(refused.empty());
}

}  // namespace
}  // namespace rigcal::server::repeated_rows_test

// SPDX-License-Identifier: Apache-2.0
#include "server/associate/unseen_markers.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace rigcal::server::unseen_markers_test {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

// Two markers in 100 rows, the second of which is at (0, 0) in the last `zeros` rows.
std::vector<CameraTrack> Tracks(size_t zeros) {
  CameraTrack track;
  track.session_id = "s";
  track.camera.camera = "a";
  for (size_t i = 0; i < 100; ++i) {
    Observation row;
    row.time_ns = static_cast<int64_t>(i);
    row.markers.resize(2);
    for (MarkerObservation& marker : row.markers) {
      marker.visible = true;
      marker.centre_px = {10.0 + static_cast<double>(i), 20};
    }
    if (i + zeros >= 100) row.markers[1].centre_px = {0, 0};
    track.observations.push_back(row);
  }
  return {track};
}

size_t Visible(const std::vector<CameraTrack>& tracks) {
  size_t count = 0;
  for (const Observation& row : tracks[0].observations) {
    count += static_cast<size_t>(row.VisibleCount());
  }
  return count;
}

TEST(HideMarkersAtOrigin, ZerosThatStandForNotSeenAreNotSeen) {
  std::vector<CameraTrack> tracks = Tracks(30);
  const std::vector<StampFault> faults = HideMarkersAtOrigin(&tracks);
  ASSERT_THAT(faults, SizeIs(1));
  EXPECT_EQ(faults[0].kind, StampFault::Kind::kAtOrigin);
  EXPECT_EQ(faults[0].size, 30);
  EXPECT_THAT(faults[0].what, HasSubstr("30 of its 200 markers"));
  EXPECT_EQ(Visible(tracks), 170u);
}

TEST(HideMarkersAtOrigin, AFewMayBeThere) {
  std::vector<CameraTrack> tracks = Tracks(5);
  EXPECT_THAT(HideMarkersAtOrigin(&tracks), IsEmpty());
  EXPECT_EQ(Visible(tracks), 200u);
}

}  // namespace
}  // namespace rigcal::server::unseen_markers_test

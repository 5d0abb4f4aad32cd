// SPDX-License-Identifier: Apache-2.0
#include "server/associate/clean_track.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

namespace rigcal::server::clean_track_test {
namespace {

Observation At(int64_t time_ns, double x, uint32_t epoch = 0) {
  Observation observation;
  observation.time_ns = time_ns;
  observation.clock_epoch = epoch;
  MarkerObservation marker;
  marker.visible = true;
  marker.centre_px = {x, 5};
  observation.markers.push_back(marker);
  return observation;
}

CameraTrack Track(const std::string& camera, std::vector<Observation> observations) {
  CameraTrack track;
  track.session_id = "s";
  track.camera.camera = camera;
  track.observations = std::move(observations);
  return track;
}

std::vector<CleanTrack> Clean(std::vector<CameraTrack> tracks, RefusalCounter* refused) {
  return CleanTracks(&tracks, 1, refused);
}

uint64_t CountOf(const RefusalCounter& refused, const std::string& camera, RefusalReason reason) {
  for (const Refusal& refusal : refused.List()) {
    if (refusal.camera == camera && refusal.reason == reason) return refusal.count;
  }
  return 0;
}

TEST(CleanTracks, SortsByEpochThenTimeWhateverTheOrder) {
  std::vector<Observation> rows = {At(30, 3), At(10, 1), At(20, 9, 1), At(20, 2)};
  RefusalCounter refused;
  const auto forward = Clean({Track("b", rows), Track("a", {At(5, 1)})}, &refused);
  std::reverse(rows.begin(), rows.end());
  const auto backward = Clean({Track("a", {At(5, 1)}), Track("b", rows)}, &refused);
  ASSERT_EQ(forward.size(), 3u);
  EXPECT_TRUE(refused.empty());
  EXPECT_EQ(forward[0].camera.camera, "a");
  EXPECT_EQ(forward[1].clock_epoch, 0u);
  EXPECT_EQ(forward[2].clock_epoch, 1u);
  ASSERT_EQ(forward[1].observations.size(), 3u);
  for (size_t t = 0; t < forward.size(); ++t) {
    ASSERT_EQ(forward[t].observations.size(), backward[t].observations.size());
    for (size_t i = 0; i < forward[t].observations.size(); ++i) {
      EXPECT_EQ(forward[t].observations[i].time_ns, backward[t].observations[i].time_ns);
    }
  }
  EXPECT_EQ(forward[1].observations[0].time_ns, 10);
  EXPECT_EQ(forward[1].observations[2].time_ns, 30);
}

TEST(CleanTracks, KeepsOneOfEqualDuplicates) {
  RefusalCounter refused;
  const auto tracks = Clean({Track("a", {At(10, 1), At(20, 2), At(10, 1), At(10, 1)})}, &refused);
  ASSERT_EQ(tracks[0].observations.size(), 2u);
  EXPECT_EQ(CountOf(refused, "a", RefusalReason::kDuplicateEqual), 2u);
}

TEST(CleanTracks, LeavesOutAllOfConflictingDuplicates) {
  RefusalCounter refused;
  const auto tracks = Clean({Track("a", {At(10, 1), At(20, 2), At(10, 1), At(10, 1.5)})}, &refused);
  ASSERT_EQ(tracks[0].observations.size(), 1u);
  EXPECT_EQ(tracks[0].observations[0].time_ns, 20);
  EXPECT_EQ(CountOf(refused, "a", RefusalReason::kDuplicateConflict), 3u);
}

TEST(CleanTracks, SameTimeInAnotherEpochOrSessionIsNoDuplicate) {
  CameraTrack other = Track("a", {At(10, 7)});
  other.session_id = "t";
  RefusalCounter refused;
  const auto tracks = Clean({Track("a", {At(10, 1), At(10, 2, 1)}), other}, &refused);
  EXPECT_EQ(tracks.size(), 3u);
  EXPECT_TRUE(refused.empty());
}

TEST(CleanTracks, TakesPartsOfOneCameraTogether) {
  RefusalCounter refused;
  const auto tracks = Clean({Track("a", {At(20, 1)}), Track("a", {At(10, 1)})}, &refused);
  ASSERT_EQ(tracks.size(), 1u);
  EXPECT_EQ(tracks[0].observations[0].time_ns, 10);
}

TEST(CleanTracks, CountsUnusableValuesByCause) {
  Observation not_finite = At(10, std::numeric_limits<double>::quiet_NaN());
  Observation flat = At(20, 1);
  flat.markers[0].covariance_px2.setZero();
  Observation two_markers = At(30, 1);
  two_markers.markers.push_back(two_markers.markers[0]);
  Observation empty;
  empty.time_ns = 40;
  RefusalCounter refused;
  const auto tracks = Clean({Track("a", {not_finite, flat, two_markers, empty})}, &refused);
  EXPECT_EQ(CountOf(refused, "a", RefusalReason::kValueNotFinite), 1u);
  EXPECT_EQ(CountOf(refused, "a", RefusalReason::kCovarianceNotPositive), 1u);
  EXPECT_EQ(CountOf(refused, "a", RefusalReason::kMarkerCountMismatch), 1u);
  ASSERT_EQ(tracks.size(), 1u);
  EXPECT_EQ(tracks[0].observations.size(), 1u);
}

}  // namespace
}  // namespace rigcal::server::clean_track_test

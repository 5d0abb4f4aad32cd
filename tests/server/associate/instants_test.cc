// SPDX-License-Identifier: Apache-2.0
#include "server/associate/instants.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <tuple>

#include "tests/server/associate/edit_rows.h"

namespace rigcal::server::instants_test {
namespace {

constexpr int64_t kMs = 1'000'000;

AlignedTrack Track(const std::string& session, const std::string& camera,
                   const std::vector<int64_t>& times_ms, double period_s = 0.1) {
  AlignedTrack track;
  track.track.session_id = session;
  track.track.camera.camera = camera;
  track.period_s = period_s;
  for (const int64_t time_ms : times_ms) {
    Observation observation;
    observation.time_ns = time_ms * kMs;
    MarkerObservation marker;
    marker.visible = true;
    observation.markers.push_back(marker);
    track.track.observations.push_back(observation);
  }
  return track;
}

InstantList Find(const std::vector<AlignedTrack>& tracks, double tolerance_s = 0) {
  return FindInstants(tracks, CoarseRigTimes(tracks), tolerance_s);
}

// Instants with both of these tracks.
int Shared(const InstantList& list, int a, int b) {
  int count = 0;
  for (const Instant& instant : list.instants) {
    const auto tracks = std::ranges::count_if(
        instant.members, [=](const InstantMember& m) { return m.track == a || m.track == b; });
    count += tracks == 2 ? 1 : 0;
  }
  return count;
}

TEST(FindInstants, GroupsByTimeNotByRow) {
  const auto list = Find({Track("s", "a", {0, 100, 200, 300}), Track("s", "b", {102, 201, 401})});
  ASSERT_EQ(list.instants.size(), 2u);
  EXPECT_EQ(list.instants[0].rig_time_ns, 101 * kMs);
  EXPECT_EQ(list.instants[0].members[0].observation, 1);
  EXPECT_EQ(list.instants[0].members[1].observation, 0);
  EXPECT_EQ(list.alone_count, (std::vector<uint32_t>{2, 1}));
  EXPECT_EQ(Shared(list, 0, 1), 2);
}

TEST(FindInstants, ToleranceIsAQuarterOfTheSmallestPeriod) {
  const std::vector<AlignedTrack> tracks = {Track("s", "a", {0, 1000}, 0.1),
                                            Track("s", "b", {24, 1026}, 0.12)};
  EXPECT_EQ(Find(tracks).instants.size(), 1u);
  EXPECT_EQ(Find(tracks, 0.03).instants.size(), 2u);
  EXPECT_EQ(Find(tracks, 0.01).instants.size(), 0u);
}

TEST(FindInstants, EmptyObservationsTakeNoPart) {
  std::vector<AlignedTrack> tracks = {Track("s", "a", {0}), Track("s", "b", {0})};
  EditRow(&tracks[1], 0, [](Observation& row) { row.markers[0].visible = false; });
  const auto list = Find(tracks);
  EXPECT_TRUE(list.instants.empty());
  EXPECT_EQ(list.alone_count, (std::vector<uint32_t>{1, 0}));
}

TEST(FindInstants, NeverMixesSessions) {
  const auto list = Find(
      {Track("s", "a", {0}), Track("s", "b", {0}), Track("t", "a", {0}), Track("t", "c", {500})});
  ASSERT_EQ(list.instants.size(), 1u);
  EXPECT_EQ(list.instants[0].members.size(), 2u);
  EXPECT_EQ(list.alone_count, (std::vector<uint32_t>{0, 0, 1, 1}));
}

TEST(FindInstants, HasEachCameraOnceEvenWithAWideTolerance) {
  const auto list =
      Find({Track("s", "a", {0, 10, 20, 30}, 0.01), Track("s", "b", {1, 11, 21, 31}, 0.01)}, 1.0);
  for (const Instant& instant : list.instants) {
    std::set<int> tracks;
    for (const InstantMember& member : instant.members) {
      EXPECT_TRUE(tracks.insert(member.track).second);
    }
  }
  EXPECT_EQ(list.instants.size(), 4u);
}

TEST(FindInstants, CamerasThatRunFreelyShareAPeriodOfTheSlowest) {
  std::vector<int64_t> slow, other, fast;
  for (int64_t t = 0; t < 2000; t += 100) slow.push_back(t + 45), other.push_back(t + 85);
  for (int64_t t = 0; t < 2000; t += 40) fast.push_back(t + 15);
  const auto list =
      Find({Track("s", "a", slow, 0.1), Track("s", "b", fast, 0.04), Track("s", "c", other, 0.1)});
  EXPECT_GE(list.instants.size(), 19u);
  // The fast one's other rows are nobody else's.
  EXPECT_GT(list.skipped_count[1], 20u);
  EXPECT_EQ(list.alone_count[1], 0u);
  for (const Instant& instant : list.instants) {
    for (const InstantMember& member : instant.members) {
      EXPECT_LT(member.track, 3);
    }
  }
}

// Two event cameras at 200 Hz, whose rows are those of the nearest blink, beside frame cameras at
// 50 Hz: no row is lost, and the instants of the frames have all cameras.
TEST(FindInstants, FastCamerasShareWhatTheySeeBetweenTheSlowOnes) {
  std::vector<int64_t> frames, left, right;
  for (int64_t t = 0; t < 1000; t += 20) frames.push_back(t);
  for (int64_t t = 0; t < 1000; t += 10) {
    left.push_back(t), left.push_back(t + 4);
    right.push_back(t + 2), right.push_back(t + 6);
  }
  const std::vector<AlignedTrack> tracks = {
      Track("s", "left", left, 0.005), Track("s", "north", frames, 0.02),
      Track("s", "right", right, 0.005), Track("s", "south", frames, 0.02)};
  const InstantList list = Find(tracks);
  EXPECT_EQ(list.instants.size(), 200u);
  EXPECT_EQ(list.instant_count, (std::vector<uint32_t>{200, 50, 200, 50}));
  EXPECT_EQ(Shared(list, 0, 2), 200);
  EXPECT_EQ(Shared(list, 0, 1), 50);
  EXPECT_EQ(Shared(list, 1, 3), 50);
  for (size_t i = 1; i < list.instants.size(); ++i) {
    EXPECT_LT(list.instants[i - 1].rig_time_ns, list.instants[i].rig_time_ns);
  }
  // A row is in one instant only, and near its time.
  std::set<std::tuple<int, int>> rows;
  for (const Instant& instant : list.instants) {
    for (const InstantMember& member : instant.members) {
      EXPECT_TRUE(rows.insert({member.track, member.observation}).second);
      const int64_t row_ns = tracks[static_cast<size_t>(member.track)]
                                 .track.observations[static_cast<size_t>(member.observation)]
                                 .time_ns;
      EXPECT_LE(std::abs(row_ns - instant.rig_time_ns), 2 * kMs);
    }
  }
}

// Slow cameras that run freely have no instants that the fast ones could join: an instant is as
// wide as the slowest period and has every camera.
TEST(FindInstants, FastCamerasBesideSlowOnesThatRunFreely) {
  std::vector<int64_t> one, two, three, fast, faster;
  for (int64_t t = 0; t < 2000; t += 20) one.push_back(t), two.push_back(t + 7);
  for (int64_t t = 0; t < 2000; t += 20) three.push_back(t + 14);
  for (int64_t t = 0; t < 2000; t += 8) fast.push_back(t + 3), faster.push_back(t + 6);
  const InstantList list = Find({Track("s", "fast", fast, 0.008),
                                 Track("s", "faster", faster, 0.008), Track("s", "one", one, 0.02),
                                 Track("s", "three", three, 0.02), Track("s", "two", two, 0.02)});
  EXPECT_NEAR(static_cast<double>(list.instants.size()), 100, 5);
  for (int other = 1; other < 5; ++other) {
    EXPECT_GE(Shared(list, 0, other), 90) << other;
  }
}

// One slow camera beside a fast one has no instant with itself.
TEST(FindInstants, AFastCameraJoinsASingleSlowOne) {
  const InstantList list = Find({Track("s", "fast", {1, 6, 11, 16, 21, 26, 900}, 0.005),
                                 Track("s", "slow", {0, 20, 40}, 0.02)});
  EXPECT_EQ(list.instants.size(), 2u);
  EXPECT_EQ(list.alone_count, (std::vector<uint32_t>{1, 1}));  // at 900, at 40
  EXPECT_EQ(list.skipped_count, (std::vector<uint32_t>{4, 0}));
}

// One camera among many that runs beside the others would be left alone for good.
TEST(FindInstants, ACameraThatRunsBesideTheOthersIsNotStarved) {
  std::vector<AlignedTrack> tracks;
  for (const char* camera : {"a", "b", "c", "d", "e"}) {
    tracks.push_back(Track("s", camera, {0, 100, 200, 300, 400, 500}));
  }
  tracks.push_back(Track("s", "f", {40, 140, 240, 340, 440, 540}));
  const InstantList list = Find(tracks);
  EXPECT_EQ(list.instants.size(), 6u);
  EXPECT_EQ(Shared(list, 0, 5), 6);
  EXPECT_EQ(Shared(list, 0, 1), 6);
}

TEST(FindInstants, EveryWandViewIsInAnInstantOrAlone) {
  const std::vector<AlignedTrack> tracks = {
      Track("s", "a", {0, 90, 130, 170}), Track("s", "b", {5, 80, 260}), Track("s", "c", {7, 500})};
  const auto list = Find(tracks);
  for (size_t t = 0; t < tracks.size(); ++t) {
    EXPECT_EQ(list.alone_count[t] + list.instant_count[t] + list.skipped_count[t],
              tracks[t].track.observations.size());
  }
}

}  // namespace
}  // namespace rigcal::server::instants_test

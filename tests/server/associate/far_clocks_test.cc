// SPDX-License-Identifier: Apache-2.0
#include "server/associate/far_clocks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace rigcal::server::far_clocks_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

constexpr int64_t kSince1970Ns = 1'700'000'000'000'000'123;
constexpr int64_t kSinceBootNs = 1'000'000'000'000;
constexpr int64_t kMinuteNs = 60'000'000'000;

CameraTrack TrackOf(const std::string& camera, int64_t first_ns) {
  CameraTrack track;
  track.session_id = "s";
  track.camera.camera = camera;
  track.camera.clock.clock_id = camera;
  track.observations.resize(2);
  track.observations[0].time_ns = first_ns;
  track.observations[1].time_ns = first_ns + kMinuteNs;
  return track;
}

struct Brought {
  std::map<ClockKey, ClockOffset> known;
  std::vector<StampFault> faults;
};

Brought Bring(const std::vector<CameraTrack>& tracks) {
  std::vector<CleanTrack> clean;
  Brought brought;
  for (const CameraTrack& track : tracks) {
    clean.push_back({track.session_id, track.camera, 0, track.observations});
    brought.known[{"s", track.camera.clock.clock_id, 0}] = {};
  }
  BringFarClocksTogether(clean, &brought.known, &brought.faults);
  return brought;
}

TEST(BringFarClocksTogether, TheSmallerGroupGetsAnOffsetInWholeNanoseconds) {
  const Brought brought = Bring({TrackOf("a", kSince1970Ns), TrackOf("b", kSince1970Ns + 7),
                                 TrackOf("c", kSinceBootNs), TrackOf("d", kSince1970Ns + 9)});
  EXPECT_EQ(brought.known.at({"s", "a", 0}).offset_ns, 0);
  EXPECT_EQ(brought.known.at({"s", "b", 0}).offset_ns, 0);
  // Middles, which are those of halves, are right to a nanosecond.
  EXPECT_NEAR(static_cast<double>(brought.known.at({"s", "c", 0}).offset_ns -
                                  (kSince1970Ns + 7 - kSinceBootNs)),
              0, 1);
  ASSERT_THAT(brought.faults, SizeIs(1));
  EXPECT_EQ(brought.faults[0].camera, "c");
  EXPECT_THAT(brought.faults[0].what, HasSubstr("than that of a, b, d"));
}

TEST(BringFarClocksTogether, ClocksThatAreHoursApartStay) {
  const Brought brought =
      Bring({TrackOf("a", kSinceBootNs), TrackOf("b", kSinceBootNs + 120 * kMinuteNs)});
  for (const auto& [key, offset] : brought.known) EXPECT_EQ(offset.offset_ns, 0);
  EXPECT_THAT(brought.faults, IsEmpty());
}

TEST(BringFarClocksTogether, ACameraWithRowsInBothStays) {
  std::vector<CleanTrack> clean;
  std::map<ClockKey, ClockOffset> known;
  for (const uint32_t epoch : {0u, 1u}) {
    const CameraTrack track = TrackOf("a", epoch == 0 ? kSince1970Ns : kSinceBootNs);
    clean.push_back({"s", track.camera, epoch, track.observations});
    known[{"s", "a", epoch}] = {};
  }
  BringFarClocksTogether(clean, &known, nullptr);
  for (const auto& [key, offset] : known) EXPECT_EQ(offset.offset_ns, 0);
}

TEST(BringFarClocksTogether, StampsAtTheEndsOfWhatFitsAreLeftAlone) {
  const Brought brought = Bring({TrackOf("a", std::numeric_limits<int64_t>::min()),
                                 TrackOf("b", std::numeric_limits<int64_t>::max() - kMinuteNs)});
  for (const auto& [key, offset] : brought.known) EXPECT_EQ(offset.offset_ns, 0);
  EXPECT_THAT(Bring({}).faults, IsEmpty());
}

TEST(DescribeFarClocks, NamesTheGroups) {
  EXPECT_THAT(DescribeFarClocks({TrackOf("a", kSince1970Ns), TrackOf("b", kSince1970Ns),
                                 TrackOf("c", kSinceBootNs), TrackOf("d", kSinceBootNs)}),
              AllOf(HasSubstr("a, b count since 1970"), HasSubstr("c, d count from another")));
  EXPECT_EQ(DescribeFarClocks({TrackOf("a", kSince1970Ns), TrackOf("b", kSince1970Ns)}), "");
  EXPECT_EQ(DescribeFarClocks({}), "");
}

}  // namespace
}  // namespace rigcal::server::far_clocks_test

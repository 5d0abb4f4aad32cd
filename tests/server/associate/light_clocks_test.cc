// SPDX-License-Identifier: Apache-2.0
#include "server/associate/light_clocks.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "server/associate/align_clocks.h"

namespace rigcal::server::light_clocks_test {
namespace {

constexpr int64_t kSecondNs = 1'000'000'000;
constexpr int64_t kDayNs = 86'400 * kSecondNs;

// A camera that reads a wand once a second from `from_s` until `until_s` of the rig's time.
struct Reader {
  std::string camera;
  int64_t clock_ahead_ns = 0;  // of the rig's time
  uint32_t wand = 1;
  double from_s = 5, until_s = 25;
  double wand_on_s = 1000;  // at rig time 0
  double wand_rate = 1;
};

CameraTrack TrackOf(const Reader& reader, const std::string& timebase = "") {
  CameraTrack track;
  track.session_id = "s";
  track.camera.camera = reader.camera;
  track.camera.clock = {reader.camera + "-clock", timebase};
  for (int i = 0; i < 10; ++i) {
    Observation row;
    row.time_ns = i * kSecondNs + reader.clock_ahead_ns;
    track.observations.push_back(row);
  }
  for (double time_s = reader.from_s; time_s < reader.until_s; time_s += 1) {
    const double wand_s = reader.wand_on_s + reader.wand_rate * time_s;
    track.clock_samples.push_back({0,
                                   {.device_ns = std::llround(1e9 * time_s) + reader.clock_ahead_ns,
                                    .uncertainty_ns = 1'000'000,
                                    .light = reader.wand,
                                    .light_ns = std::llround(1e9 * wand_s)}});
  }
  return track;
}

struct Outcome {
  std::vector<AlignedTrack> tracks;
  std::vector<StampFault> faults;
  RefusalCounter refused;

  double ErrorS(size_t track, int64_t ahead_ns) const {
    return 1e-9 * static_cast<double>(tracks[track].clock_offset_ns - tracks[0].clock_offset_ns +
                                      ahead_ns);
  }
};

Outcome Align(std::vector<CameraTrack> tracks) {
  Outcome outcome;
  std::vector<CameraTrack> rows = tracks;
  outcome.tracks = AlignClocks(tracks, CleanTracks(&rows, 1, &outcome.refused), &outcome.refused,
                               &outcome.faults);
  return outcome;
}

TEST(LightClocks, RelatesClocksThatAreADayApart) {
  // Neither a time base nor a reading of a PC.
  const Outcome outcome =
      Align({TrackOf({.camera = "a"}), TrackOf({.camera = "b", .clock_ahead_ns = kDayNs + 7}),
             TrackOf({.camera = "c", .clock_ahead_ns = -kDayNs / 2})});
  ASSERT_EQ(outcome.tracks.size(), 3u);
  EXPECT_NEAR(outcome.ErrorS(1, kDayNs + 7), 0, 1e-6);
  EXPECT_NEAR(outcome.ErrorS(2, -kDayNs / 2), 0, 1e-6);
  for (const AlignedTrack& track : outcome.tracks) EXPECT_EQ(track.wand, 1u);
  ASSERT_EQ(outcome.faults.size(), 2u);
  EXPECT_EQ(outcome.faults[0].kind, StampFault::Kind::kSetByLight);
  EXPECT_EQ(outcome.faults[0].camera, "b");
  EXPECT_TRUE(outcome.refused.empty());
}

TEST(LightClocks, SetsClocksOfOneTimeBaseOnlyWhereTheyAreOff) {
  const Outcome outcome =
      Align({TrackOf({.camera = "a"}, "ptp"),
             TrackOf({.camera = "b", .clock_ahead_ns = 15'000'000}, "ptp"),
             TrackOf({.camera = "c", .clock_ahead_ns = 3'600 * kSecondNs}, "ptp")});
  ASSERT_EQ(outcome.tracks.size(), 3u);
  EXPECT_EQ(outcome.tracks[1].clock_offset_ns, outcome.tracks[0].clock_offset_ns);
  EXPECT_NEAR(outcome.ErrorS(2, 3'600 * kSecondNs), 0, 1e-6);
}

TEST(LightClocks, FollowsAWandWhoseBatterySags) {
  // Read one after the other, with two seconds between them.
  const Outcome outcome =
      Align({TrackOf({.camera = "a", .from_s = 0, .until_s = 12, .wand_rate = 0.98}),
             TrackOf({.camera = "b",
                      .clock_ahead_ns = kDayNs,
                      .from_s = 13,
                      .until_s = 30,
                      .wand_rate = 0.98})});
  ASSERT_EQ(outcome.tracks.size(), 2u);
  EXPECT_NEAR(outcome.ErrorS(1, kDayNs), 0, 0.4);
  ASSERT_EQ(outcome.faults.size(), 2u);  // the other one: b was set
  EXPECT_EQ(outcome.faults[0].kind, StampFault::Kind::kWandRate);
  EXPECT_NEAR(outcome.faults[0].size, -2, 0.1);
}

TEST(LightClocks, OneCameraWithoutTheCodeKeepsWhatItHas) {
  CameraTrack plain = TrackOf({.camera = "b", .until_s = 0});
  const Outcome outcome = Align({TrackOf({.camera = "a"}), plain});
  EXPECT_TRUE(outcome.tracks.empty());  // nothing relates the two
  EXPECT_FALSE(outcome.refused.empty());
  const Outcome with_base =
      Align({TrackOf({.camera = "a"}, "ptp"), TrackOf({.camera = "b", .until_s = 0}, "ptp")});
  ASSERT_EQ(with_base.tracks.size(), 2u);
  EXPECT_EQ(with_base.tracks[1].wand, 0u);
}

TEST(LightClocks, TwoWandsWithOneNumberAreAFault) {
  CameraTrack both = TrackOf({.camera = "b", .until_s = 15});
  const CameraTrack other = TrackOf({.camera = "b", .from_s = 15, .wand_on_s = 70'000});
  both.clock_samples.insert(both.clock_samples.end(), other.clock_samples.begin(),
                            other.clock_samples.end());
  CameraTrack first = TrackOf({.camera = "a"}, "ptp");
  const CameraTrack second =
      TrackOf({.camera = "a", .from_s = 0, .until_s = 4, .wand_on_s = 70'030});
  first.clock_samples.insert(first.clock_samples.end(), second.clock_samples.begin(),
                             second.clock_samples.end());
  both.camera.clock.timebase = "ptp";
  const Outcome outcome = Align({first, both});
  ASSERT_EQ(outcome.tracks.size(), 2u);
  ASSERT_FALSE(outcome.faults.empty());
  EXPECT_EQ(outcome.faults[0].kind, StampFault::Kind::kLightContradicts);
  EXPECT_EQ(outcome.tracks[1].clock_offset_ns, outcome.tracks[0].clock_offset_ns);
}

TEST(LightClocks, CamerasThatReadDifferentWandsAreNamed) {
  const Outcome outcome =
      Align({TrackOf({.camera = "a"}, "ptp"), TrackOf({.camera = "b"}, "ptp"),
             TrackOf({.camera = "c", .clock_ahead_ns = 5 * kSecondNs, .wand = 2}, "ptp")});
  ASSERT_EQ(outcome.tracks.size(), 3u);
  EXPECT_EQ(outcome.tracks[2].clock_offset_ns, 0);
  ASSERT_EQ(outcome.faults.size(), 1u);
  EXPECT_EQ(outcome.faults[0].kind, StampFault::Kind::kOtherWand);
  EXPECT_EQ(outcome.faults[0].camera, "c");
}

// A wave of 12 s gives few readings, not far apart.
TEST(LightClocks, AShortWaveShowsTheRateToo) {
  const Outcome outcome =
      Align({TrackOf({.camera = "a", .from_s = 5, .until_s = 8, .wand_rate = 1.02}, "ptp"),
             TrackOf({.camera = "b", .from_s = 5, .until_s = 8, .wand_rate = 1.02}, "ptp")});
  ASSERT_EQ(outcome.faults.size(), 1u);
  EXPECT_EQ(outcome.faults[0].kind, StampFault::Kind::kWandRate);
  EXPECT_NEAR(outcome.faults[0].size, 2, 0.1);
}

// One against one: neither is the odd one.
TEST(LightClocks, TwoCamerasOfWhichEachHasReadAnotherWandAreBothNamed) {
  const Outcome outcome =
      Align({TrackOf({.camera = "a"}, "ptp"), TrackOf({.camera = "b", .wand = 2}, "ptp")});
  ASSERT_EQ(outcome.faults.size(), 2u);
  for (const StampFault& fault : outcome.faults) {
    EXPECT_EQ(fault.kind, StampFault::Kind::kOtherWand);
    EXPECT_NE(fault.what.find("a: 1; b: 2"), std::string::npos) << fault.what;
  }
}

TEST(LightClocks, AnyReadingsAtAllAreBorne) {
  CameraTrack wild = TrackOf({.camera = "a"});
  for (const int64_t time_ns : {int64_t{0}, int64_t{1}, int64_t{1} << 62}) {
    for (const int64_t light_ns : {int64_t{0}, int64_t{1} << 62}) {
      wild.clock_samples.push_back({0, {.device_ns = time_ns, .light = 1, .light_ns = light_ns}});
    }
  }
  const Outcome outcome = Align({wild, TrackOf({.camera = "b", .clock_ahead_ns = kDayNs})});
  EXPECT_LE(outcome.tracks.size(), 2u);
}

}  // namespace
}  // namespace rigcal::server::light_clocks_test

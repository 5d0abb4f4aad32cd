// SPDX-License-Identifier: Apache-2.0
#include "server/associate/straight_clocks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <optional>
#include <random>
#include <set>

#include "common/time/clock.h"

namespace rigcal::server::straight_clocks_test {
namespace {

using ::testing::Contains;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::Field;
using ::testing::IsEmpty;

constexpr int64_t kPeriodNs = 40'000'000;
constexpr int64_t kHourNs = 3'600'000'000'000;
constexpr int kRows = 500;

// Stamps of kRows frames from one second on.
std::vector<int64_t> Stamps() {
  std::vector<int64_t> stamps_ns;
  for (int i = 0; i < kRows; ++i) stamps_ns.push_back(1'000'000'000 + i * kPeriodNs);
  return stamps_ns;
}

// As an agent makes them: a clock epoch begins wherever a stamp is less than the one before. The
// marker is at x = the row's true number.
CameraTrack TrackOf(const std::string& camera, const std::vector<int64_t>& stamps_ns) {
  CameraTrack track;
  track.session_id = "s";
  track.camera.camera = camera;
  track.camera.clock = {camera, "recording"};
  ClockEpochCounter epochs;
  for (size_t i = 0; i < stamps_ns.size(); ++i) {
    Observation row;
    row.time_ns = stamps_ns[i];
    row.clock_epoch = epochs.EpochOf(row.time_ns);
    row.markers.resize(1);
    row.markers[0].visible = true;
    row.markers[0].centre_px = {3.0 * static_cast<double>(i), 100};
    track.observations.push_back(row);
  }
  return track;
}

struct Straightened {
  std::vector<CameraTrack> tracks;
  std::vector<StampFault> faults;
  uint64_t refused = 0;

  // The largest difference between a row's time and that of its frame, after a common shift.
  int64_t WorstNs(size_t track) const {
    const std::vector<Observation>& rows = tracks[track].observations;
    const auto error_ns = [&](const Observation& row) {
      const auto frame = static_cast<int64_t>(std::lround(row.markers[0].centre_px.x() / 3));
      return row.time_ns - (1'000'000'000 + frame * kPeriodNs);
    };
    int64_t worst_ns = 0;
    for (const Observation& row : rows) worst_ns = std::max(worst_ns, std::abs(error_ns(row)));
    return worst_ns;
  }
  std::set<uint32_t> Epochs(size_t track) const {
    std::set<uint32_t> epochs;
    for (const Observation& row : tracks[track].observations) epochs.insert(row.clock_epoch);
    return epochs;
  }
};

// Two sound cameras beside.
Straightened Straighten(const std::vector<int64_t>& stamps_ns, const StepEvidence& evidence = {}) {
  Straightened result{
      {TrackOf("a", stamps_ns), TrackOf("b", Stamps()), TrackOf("c", Stamps())}, {}, 0};
  RefusalCounter refused;
  result.faults = StraightenClocks(&result.tracks, &refused, evidence);
  for (const Refusal& refusal : refused.List()) result.refused += refusal.count;
  return result;
}

TEST(StraightenClocks, LeavesASoundRecordingAlone) {
  const Straightened result = Straighten(Stamps());
  EXPECT_THAT(result.faults, IsEmpty());
  EXPECT_EQ(result.refused, 0u);
  EXPECT_EQ(result.WorstNs(0), 0);
}

TEST(StraightenClocks, OneWrongStampCostsOneRow) {
  for (const int64_t wrong_ns : {-3'000'000'000, 3'000'000'000, -kHourNs / 100, kHourNs}) {
    std::vector<int64_t> stamps_ns = Stamps();
    stamps_ns[250] += wrong_ns;
    const Straightened result = Straighten(stamps_ns);
    EXPECT_EQ(result.refused, 1u) << wrong_ns;
    EXPECT_EQ(result.tracks[0].observations.size(), 499u);
    EXPECT_EQ(result.WorstNs(0), 0);
    EXPECT_THAT(result.Epochs(0), ElementsAre(0));
  }
}

TEST(StraightenClocks, EachOfManyWrongStampsCostsItself) {
  std::vector<int64_t> stamps_ns = Stamps();
  for (size_t i = 100; i < 500; i += 20) stamps_ns[i] -= 3'010'000'000;
  const Straightened result = Straighten(stamps_ns);
  EXPECT_EQ(result.refused, 20u);
  EXPECT_EQ(result.WorstNs(0), 0);
}

TEST(StraightenClocks, ExchangedAndReversedAndShuffledRowsCostNothing) {
  std::vector<CameraTrack> tracks;
  for (const char* how : {"pairs", "reversed", "shuffled"}) {
    CameraTrack track = TrackOf("a", Stamps());
    std::vector<Observation>& rows = track.observations;
    if (how == std::string("pairs")) {
      for (size_t i = 5; i + 1 < rows.size(); i += 10) std::swap(rows[i], rows[i + 1]);
    } else if (how == std::string("reversed")) {
      std::ranges::reverse(rows);
    } else {
      std::ranges::shuffle(rows, std::mt19937(1));
    }
    ClockEpochCounter epochs;
    for (Observation& row : rows) row.clock_epoch = epochs.EpochOf(row.time_ns);
    Straightened result{{track, TrackOf("b", Stamps())}, {}, 0};
    RefusalCounter refused;
    result.faults = StraightenClocks(&result.tracks, &refused);
    EXPECT_TRUE(refused.empty()) << how;
    EXPECT_EQ(result.WorstNs(0), 0) << how;
    EXPECT_THAT(result.Epochs(0), ElementsAre(0)) << how;
    EXPECT_THAT(result.faults, Contains(Field(&StampFault::kind, StampFault::Kind::kOutOfOrder)));
  }
}

TEST(StraightenClocks, AClockThatIsSetGoesOnWhereItWas) {
  for (const int64_t step_ns : {kHourNs, -kHourNs, int64_t{-3'000'000'000}}) {
    std::vector<int64_t> stamps_ns = Stamps();
    for (size_t i = 240; i < kRows; ++i) stamps_ns[i] += step_ns;
    const Straightened result = Straighten(stamps_ns);
    EXPECT_EQ(result.refused, 0u) << step_ns;
    EXPECT_EQ(result.WorstNs(0), 0) << step_ns;
    EXPECT_THAT(result.Epochs(0), ElementsAre(0, 1)) << "the solve estimates both";
    ASSERT_THAT(result.faults, Contains(Field(&StampFault::kind, StampFault::Kind::kSteps)));
    EXPECT_NEAR(result.faults[0].size, 1e-9 * static_cast<double>(step_ns), 1e-6);
  }
}

// Knows by the markers when each row really was.
std::optional<bool> Truth(const StepQuestion& question) {
  const Observation& row = *question.rows[question.rows.size() / 2];
  const auto frame = static_cast<int64_t>(std::lround(row.markers[0].centre_px.x() / 3));
  const auto is_right = [&](int64_t moved_ns) {
    return std::abs(row.time_ns + moved_ns - (1'000'000'000 + frame * kPeriodNs)) < kPeriodNs;
  };
  if (is_right(question.moved_ns) == is_right(question.stay_ns)) return std::nullopt;
  return is_right(question.moved_ns);
}

TEST(StraightenClocks, AClockThatIsSetForwardByLittleIsFoundByTheMotion) {
  for (const int64_t step_ns : {350'000'000, 1'000'000'000, 2'000'000'000}) {
    std::vector<int64_t> stamps_ns = Stamps();
    for (size_t i = 240; i < kRows; ++i) stamps_ns[i] += step_ns;
    const Straightened result = Straighten(stamps_ns, Truth);
    EXPECT_EQ(result.refused, 0u) << step_ns;
    EXPECT_EQ(result.WorstNs(0), 0) << step_ns;
    EXPECT_THAT(result.Epochs(0), ElementsAre(0, 1));
    ASSERT_THAT(result.faults, Contains(Field(&StampFault::kind, StampFault::Kind::kSteps)));
    EXPECT_NEAR(result.faults[0].size, 1e-9 * static_cast<double>(step_ns), 1e-6);
    EXPECT_THAT(Straighten(stamps_ns).faults, IsEmpty()) << "nothing tells it from lost frames";
  }
}

TEST(StraightenClocks, EachOfTwoStepsIsFound) {
  for (const int64_t first_ns : {kHourNs, int64_t{20'000'000'000}, int64_t{350'000'000}}) {
    for (const int64_t second_ns : {first_ns, -first_ns}) {
      std::vector<int64_t> stamps_ns = Stamps();
      for (size_t i = 160; i < kRows; ++i) stamps_ns[i] += first_ns;
      for (size_t i = 330; i < kRows; ++i) stamps_ns[i] += second_ns;
      const Straightened result = Straighten(stamps_ns, Truth);
      EXPECT_EQ(result.WorstNs(0), 0) << first_ns << " " << second_ns;
      EXPECT_THAT(result.Epochs(0), ElementsAre(0, 1, 2)) << first_ns << " " << second_ns;
      ASSERT_FALSE(result.faults.empty());
      EXPECT_THAT(result.faults[0].what, ::testing::HasSubstr("set 2 times"));
    }
  }
}

TEST(StraightenClocks, LargeStepsAreFoundWithoutEvidenceToo) {
  std::vector<int64_t> stamps_ns = Stamps();
  for (size_t i = 160; i < kRows; ++i) stamps_ns[i] += kHourNs;
  for (size_t i = 330; i < kRows; ++i) stamps_ns[i] += kHourNs;
  const Straightened result = Straighten(stamps_ns);
  EXPECT_EQ(result.WorstNs(0), 0);
  EXPECT_THAT(result.Epochs(0), ElementsAre(0, 1, 2));
}

TEST(StraightenClocks, LostFramesAreNoStep) {
  CameraTrack track = TrackOf("a", Stamps());
  track.observations.erase(track.observations.begin() + 200, track.observations.begin() + 240);
  Straightened result{{track, TrackOf("b", Stamps()), TrackOf("c", Stamps())}, {}, 0};
  RefusalCounter refused;
  int asked = 0;
  result.faults =
      StraightenClocks(&result.tracks, &refused, [&asked](const StepQuestion& question) {
        ++asked;
        return Truth(question);
      });
  EXPECT_THAT(result.faults, IsEmpty());
  EXPECT_EQ(result.WorstNs(0), 0);
  EXPECT_EQ(asked, 0) << "the marker moved on as far as in 40 frames";
}

TEST(StraightenClocks, RowsBeforeASetClockMoveWhereTheRestFits) {
  std::vector<int64_t> stamps_ns = Stamps();
  for (size_t i = 0; i < 200; ++i) stamps_ns[i] += kHourNs;
  const Straightened result = Straighten(stamps_ns);
  EXPECT_EQ(result.refused, 0u);
  EXPECT_EQ(result.WorstNs(0), 0);
}

TEST(StraightenClocks, CountersThatBeginAnewTogetherStayTogether) {
  std::vector<int64_t> stamps_ns = Stamps();
  for (size_t i = 300; i < kRows; ++i) stamps_ns[i] -= 300 * kPeriodNs;
  std::vector<int64_t> other_ns = stamps_ns;
  for (int64_t& stamp_ns : other_ns) stamp_ns += 7'000'000;  // a clock that is ahead
  Straightened result{{TrackOf("a", stamps_ns), TrackOf("b", other_ns)}, {}, 0};
  RefusalCounter refused;
  result.faults = StraightenClocks(&result.tracks, &refused);
  EXPECT_TRUE(refused.empty());
  for (size_t i = 0; i < kRows; ++i) {
    EXPECT_EQ(result.tracks[1].observations[i].time_ns - result.tracks[0].observations[i].time_ns,
              7'000'000);
  }
  EXPECT_THAT(result.Epochs(0), ElementsAre(0));
  EXPECT_EQ(result.WorstNs(0), 0);
}

TEST(StraightenClocks, APauseIsNoStep) {
  std::vector<int64_t> stamps_ns = Stamps();
  for (size_t i = 300; i < kRows; ++i) stamps_ns[i] += kHourNs;
  Straightened result{{TrackOf("a", stamps_ns), TrackOf("b", stamps_ns)}, {}, 0};
  RefusalCounter refused;
  result.faults = StraightenClocks(&result.tracks, &refused);
  EXPECT_THAT(result.faults, IsEmpty());
  EXPECT_EQ(result.tracks[0].observations[400].time_ns, stamps_ns[400]);
}

TEST(StraightenClocks, AFewRowsBehindAStepAreRefused) {
  std::vector<int64_t> stamps_ns = Stamps();
  for (size_t i = 494; i < kRows; ++i) stamps_ns[i] -= 158'200'000;
  const Straightened result = Straighten(stamps_ns);
  EXPECT_EQ(result.refused, 6u);
  EXPECT_EQ(result.tracks[0].observations.size(), 494u);
}

TEST(StraightenClocks, NamesCoarseTicksAndBursts) {
  std::vector<int64_t> stamps_ns = Stamps();
  for (int64_t& stamp_ns : stamps_ns) stamp_ns = stamp_ns / 64'000'000 * 64'000'000;
  EXPECT_THAT(Straighten(stamps_ns).faults,
              Contains(Field(&StampFault::kind, StampFault::Kind::kRepeat)));
  stamps_ns = Stamps();
  for (size_t i = 0; i < kRows; ++i) {
    stamps_ns[i] = stamps_ns[i / 4 * 4 + 3 < kRows ? i / 4 * 4 + 3 : i] +
                   static_cast<int64_t>(i % 4) * 1'000'000;
  }
  EXPECT_THAT(Straighten(stamps_ns).faults,
              Contains(Field(&StampFault::kind, StampFault::Kind::kBursts)));
}

TEST(StraightenClocks, TakesAnyStamp) {
  std::vector<int64_t> stamps_ns = Stamps();
  stamps_ns[3] = std::numeric_limits<int64_t>::max();
  stamps_ns[7] = std::numeric_limits<int64_t>::min();
  const Straightened result = Straighten(stamps_ns);
  EXPECT_EQ(result.refused, 2u);
  EXPECT_EQ(result.WorstNs(0), 0);
  RefusalCounter refused;
  std::vector<CameraTrack> none, empty = {TrackOf("a", {}), TrackOf("b", {5})};
  EXPECT_THAT(StraightenClocks(&none, &refused), IsEmpty());
  EXPECT_THAT(StraightenClocks(&empty, &refused), IsEmpty());
}

}  // namespace
}  // namespace rigcal::server::straight_clocks_test

// SPDX-License-Identifier: Apache-2.0
#include "server/associate/stamp_units.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "absl/strings/str_cat.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::stamp_units_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

// A wand at 500 px/s, seen at `rate_hz`; stamps of `unit_ns` nanoseconds each.
CameraTrack Track(const std::string& camera, double rate_hz, double unit_ns) {
  CameraTrack track;
  track.camera.camera = camera;
  for (int i = 0; i < 200; ++i) {
    Observation row;
    row.time_ns = std::llround((1e10 + 1e9 * i / rate_hz) / unit_ns);
    row.markers.resize(1);
    row.markers[0].visible = true;
    row.markers[0].centre_px = {100 + std::fmod(500 * i / rate_hz, 800), 300};
    track.observations.push_back(row);
  }
  return track;
}

TEST(CheckStampUnits, AcceptsNanosecondsAtEveryRate) {
  for (const double rate_hz : {0.2, 1.0, 10.0, 25.0, 100.0, 1000.0, 19'000.0}) {
    EXPECT_THAT(CheckStampUnits({Track("a", rate_hz, 1)}), IsOk()) << rate_hz;
  }
}

TEST(CheckStampUnits, NamesCameraUnitAndFactor) {
  struct Case {
    double rate_hz, unit_ns;
    const char* words;
    const char* factor;
  };
  for (const Case& entry :
       {Case{10, 1e3, "microseconds", "by 1000"}, Case{25, 1e3, "microseconds", "by 1000"},
        Case{200, 1e3, "microseconds", "by 1000"}, Case{10, 1e6, "milliseconds", "by 1000000"},
        Case{60, 1e6, "milliseconds", "by 1000000"}, Case{25, 1e9, "seconds", "1000000000"},
        Case{10, 1e8, "row numbers", "period"}}) {
    const absl::Status status = CheckStampUnits(
        {Track("right", entry.rate_hz, 1), Track("wrong", entry.rate_hz, entry.unit_ns)});
    EXPECT_THAT(status, StatusIs(absl::StatusCode::kInvalidArgument,
                                 AllOf(HasSubstr("camera wrong"), Not(HasSubstr("camera right")),
                                       HasSubstr(entry.words), HasSubstr(entry.factor))))
        << entry.rate_hz << " " << entry.unit_ns;
  }
}

TEST(CheckStampUnits, NamesTheUnitThatAHeaderShouldHaveNamed) {
  for (const auto& [too_large, meant] :
       {std::pair(1e3, "milliseconds"), std::pair(1e6, "microseconds"),
        std::pair(1e9, "nanoseconds")}) {
    EXPECT_THAT(
        CheckStampUnits({Track("a", 10 / too_large, 1)}),
        StatusIs(absl::StatusCode::kInvalidArgument,
                 AllOf(HasSubstr(absl::StrCat(static_cast<int64_t>(too_large), " times too large")),
                       HasSubstr(absl::StrCat("they are ", meant)))));
  }
}

TEST(CheckStampUnits, NamesEveryCamera) {
  EXPECT_THAT(CheckStampUnits({Track("b", 10, 1e3), Track("a", 10, 1e3)}),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("camera a"), HasSubstr("camera b"))));
}

TEST(CheckStampUnits, RowsThatCameTwiceAreNoWholeSeconds) {
  CameraTrack track = Track("a", 25, 1);
  const auto once = track.observations;
  for (int copies = 0; copies < 2; ++copies) {
    track.observations.insert(track.observations.end(), once.begin(), once.end());
  }
  EXPECT_THAT(CheckStampUnits({track}), IsOk());
}

TEST(CheckStampUnits, AWandAtRestIsNotJudgedByItsSpeed) {
  CameraTrack track = Track("a", 10'000, 1);
  for (Observation& row : track.observations) row.markers[0].centre_px = {100, 100};
  EXPECT_THAT(CheckStampUnits({track}), IsOk());
}

TEST(CheckStampUnits, AFewRowsSayNothing) {
  CameraTrack track = Track("a", 10, 1e6);
  track.observations.resize(10);
  EXPECT_THAT(CheckStampUnits({track}), IsOk());
}

}  // namespace
}  // namespace rigcal::server::stamp_units_test

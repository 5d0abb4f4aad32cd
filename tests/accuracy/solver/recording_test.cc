// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/solver/recording.h"

#include <cmath>

#include "tests/testing/status_matchers.h"

namespace rigcal::accuracy::recording_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

server::CalibrationInput TwoCameras() {
  server::CalibrationInput input;
  for (const char* name : {"a", "b"}) {
    server::CameraTrack track;
    track.camera.camera = name;
    for (int i = 0; i < 7; ++i) {
      Observation row;
      row.time_ns = 5'000'000'000 + 1'000'000'000ll * i;
      track.observations.push_back(row);
    }
    input.tracks.push_back(track);
  }
  return input;
}

TEST(Change, ShiftsStretchesAndThinsOneCameraOnly) {
  const server::CalibrationInput input = TwoCameras();
  ASSERT_OK_AND_ASSIGN(const server::CalibrationInput changed,
                       Change(input, {"b", -0.7, 50, true}));
  EXPECT_EQ(changed.tracks[0].observations.size(), 7u);
  EXPECT_EQ(changed.tracks[0].observations[6].time_ns, input.tracks[0].observations[6].time_ns);
  const auto& rows = changed.tracks[1].observations;
  ASSERT_EQ(rows.size(), 5u);
  EXPECT_EQ(rows[0].time_ns, 4'300'000'000);
  EXPECT_EQ(rows[2].time_ns, 7'300'000'000 + 150'000);
  EXPECT_EQ(rows[4].time_ns, 10'300'000'000 + 300'000);
}

TEST(Change, NamesAMissingCamera) {
  EXPECT_THAT(Change(TwoCameras(), {"c"}),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("camera c")));
}

TEST(AgainstOthers, LeavesTheCameraItselfOut) {
  CalibrationResult result;
  for (const auto& [name, offset_s, rate_ppm] :
       {std::tuple{"a", -0.008, 0.0}, {"b", 0.001, 10.0}, {"c", -0.001, -30.0}}) {
    CalibratedCamera camera;
    camera.camera = name;
    camera.time_offset_s = offset_s;
    camera.time_rate_ppm = rate_ppm;
    camera.time_epoch_s = 100;
    result.cameras.push_back(camera);
  }
  EXPECT_NEAR(OffsetAgainstOthersS(result, "a", 100), -0.008, 1e-15);
  EXPECT_NEAR(OffsetAgainstOthersS(result, "a", 200), -0.008 + 1e-3, 1e-15);
  EXPECT_NEAR(RateAgainstOthersPpm(result, "b"), 25, 1e-12);
  EXPECT_TRUE(std::isnan(OffsetAgainstOthersS(result, "d", 0)));
}

}  // namespace
}  // namespace rigcal::accuracy::recording_test

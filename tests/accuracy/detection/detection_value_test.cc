// SPDX-License-Identifier: Apache-2.0
// A small part of `rigcal-accuracy detection_value`.
#include "tests/accuracy/detection/detection_value.h"

#include <algorithm>
#include <vector>

#include "tests/testing/status_matchers.h"

namespace rigcal::accuracy::detection_value_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

TEST(VariantWithout, LeavesOutWhatIsNamedAndRefusesWhatIsUnknown) {
  const auto variant = VariantWithout("lambert+static_background");
  ASSERT_THAT(variant, IsOk());
  EXPECT_TRUE(variant->without.Has(agent::WandMechanism::kLambertShading));
  EXPECT_FALSE(variant->without.Has(agent::WandMechanism::kPaleLevels));
  EXPECT_FALSE(variant->background);
  EXPECT_THAT(VariantWithout("lambert+magic"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("magic")));
}

// Five seconds of waving in the dark: more is known of a calibration than that it is one.
TEST(DetectionValue, CalibratesARigByWhatTheDetectorSees) {
  const std::vector<DetectionCase> rooms = RoomCases({});
  const auto dark = std::ranges::find(rooms, "dark", &DetectionCase::name);
  ASSERT_NE(dark, rooms.end());
  DetectionValueOptions options;
  options.camera_count = 3;
  options.empty_s = 0.5;
  options.duration_s = 5;
  const auto values = RunDetectionValue(options, *dark, {{.name = "today", .without = {}}});
  ASSERT_THAT(values, IsOk());
  const DetectionValue& value = values->front();
  EXPECT_EQ(value.false_wands, 0);
  EXPECT_GT(value.views_share, 0.5);
  EXPECT_LT(value.rms_px, 0.05);
  EXPECT_THAT(value.solved, IsOk());
  EXPECT_LT(value.worst_mm, 5);
}

}  // namespace
}  // namespace rigcal::accuracy::detection_value_test

// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/recorded/recorded_frame_source.h"

#include <string>

#include "tests/agent/capture/recorded/image_files.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::recorded_frame_source_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(DescribeRecordedFrames, ChecksTheSizeAgainstTheIntrinsics) {
  const TemporaryDirectory directory;
  const std::string yaml = directory.WriteFile("c.yaml", kSmallCameraYaml).string();
  RecordedFramesOptions options;
  options.camera = "left";
  options.calibration_path = yaml;
  ASSERT_OK_AND_ASSIGN(const CameraDescription description,
                       DescribeRecordedFrames("images", options, {64, 48}, "a.png"));
  EXPECT_EQ(description.image_size_px, (ImageSize{64, 48}));
  ASSERT_TRUE(description.intrinsics.has_value());
  EXPECT_EQ(description.intrinsics->fx_px, 60);
  EXPECT_EQ(description.clock, (Clock{"left", "recording"}));
  EXPECT_THAT(DescribeRecordedFrames("images", options, {32, 24}, "a.png"),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("camera left"), HasSubstr("a.png is 32x24"),
                             HasSubstr("64x48"), HasSubstr("c.yaml"))));
  options.calibration_path = "/nowhere.yaml";
  EXPECT_THAT(DescribeRecordedFrames("images", options, {64, 48}, "a.png"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("calibration=FILE")));
  options.calibration_path.clear();
  ASSERT_OK_AND_ASSIGN(const CameraDescription bare,
                       DescribeRecordedFrames("images", options, {32, 24}, "a.png"));
  EXPECT_FALSE(bare.intrinsics.has_value());
}

TEST(RecordedFramesOptions, ListsEveryFault) {
  RecordedFramesOptions options;
  options.fps = -1;
  options.exposure_s = 11;
  options.speed = 0;
  EXPECT_THAT(options.Validate(),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("camera's name"), HasSubstr("path"), HasSubstr("fps=-1"),
                             HasSubstr("exposure=11"), HasSubstr("speed=0"))));
}

}  // namespace
}  // namespace rigcal::agent::recorded_frame_source_test

// SPDX-License-Identifier: Apache-2.0
#include "common/camera/camera_description.h"

#include <limits>

#include "tests/testing/status_matchers.h"

namespace rigcal::camera_description_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

CameraDescription Good() {
  CameraDescription camera;
  camera.camera = "frame_0";
  camera.image_size_px = {1280, 1024};
  camera.intrinsics = Intrinsics{DistortionModel::kBrownConrady, 1250, 1250, 640, 512, {}};
  camera.clock.clock_id = "frame_0";
  camera.sensor = SensorKind::kFrame;
  return camera;
}

TEST(CameraDescription, AcceptsACameraWithAndWithoutIntrinsics) {
  CameraDescription camera = Good();
  EXPECT_THAT(camera.Validate(), IsOk());
  camera.intrinsics.reset();
  EXPECT_THAT(camera.Validate(), IsOk());
}

TEST(CameraDescription, NamesTheCameraFirstAndListsEveryFault) {
  CameraDescription camera = Good();
  camera.image_size_px.width = 0;
  camera.intrinsics->fy_px = -1;
  camera.clock.clock_id.clear();
  camera.latency_s = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(camera.Validate(),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(StartsWith("camera \"frame_0\""), HasSubstr("image size"),
                             HasSubstr("fy_px"), HasSubstr("clock_id"), HasSubstr("latency_s"))));
}

TEST(CameraDescription, RefusesBadNamesKindsAndTexts) {
  CameraDescription camera = Good();
  camera.camera = "../etc";
  EXPECT_THAT(camera.Validate(), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("name")));
  camera = Good();
  camera.sensor = static_cast<SensorKind>(9);
  EXPECT_THAT(camera.Validate(), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("sensor")));
  camera = Good();
  camera.source = "csv:a\nb";
  EXPECT_THAT(camera.Validate(), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("source")));
  camera = Good();
  camera.clock.timebase.assign(1000, 'x');
  EXPECT_THAT(camera.Validate(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("timebase")));
  camera = Good();
  camera.latency_s = 11;
  EXPECT_THAT(camera.Validate(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("latency_s")));
}

}  // namespace
}  // namespace rigcal::camera_description_test

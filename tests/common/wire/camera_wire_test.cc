// SPDX-License-Identifier: Apache-2.0
#include "common/wire/camera_wire.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "tests/testing/status_matchers.h"

namespace rigcal::wire::camera_wire_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;

CameraDescription WithSettings() {
  CameraDescription camera;
  camera.camera = "left";
  camera.image_size_px = {1280, 1024};
  camera.clock = {"left", ""};
  camera.latency_s = 0.002;
  camera.sensor = SensorKind::kFrame;
  camera.source = "aravis:Fake_1";
  camera.settings = CameraSettings{.model = "Aravis Fake GV01",
                                   .pixel_format = "BayerRG8",
                                   .exposure_s = 0.005,
                                   .gain_db = -1.5,
                                   .frame_rate_hz = 50,
                                   .trigger = "Line0",
                                   .ptp = true};
  return camera;
}

TEST(CameraWire, KeepsEverySetting) {
  ASSERT_OK_AND_ASSIGN(const CameraDescription back, FromProto(ToProto(WithSettings())));
  EXPECT_EQ(back, WithSettings());
}

TEST(CameraWire, SettingsMayBeAbsent) {
  CameraDescription camera = WithSettings();
  camera.settings.reset();
  const v1::CameraDescription proto = ToProto(camera);
  EXPECT_FALSE(proto.has_settings());
  ASSERT_OK_AND_ASSIGN(const CameraDescription back, FromProto(proto));
  EXPECT_EQ(back, camera);
}

TEST(CameraWire, RefusesSettingsThatCannotBe) {
  v1::CameraDescription proto = ToProto(WithSettings());
  proto.mutable_settings()->set_model(std::string(257, 'x'));
  proto.mutable_settings()->set_trigger("Line0\n");
  proto.mutable_settings()->set_exposure_s(-1);
  proto.mutable_settings()->set_gain_db(std::nan(""));
  proto.mutable_settings()->set_frame_rate_hz(INFINITY);
  EXPECT_THAT(FromProto(proto), StatusIs(absl::StatusCode::kInvalidArgument,
                                         AllOf(HasSubstr("left"), HasSubstr("model has 257 bytes"),
                                               HasSubstr("trigger"), HasSubstr("exposure_s"),
                                               HasSubstr("gain_db"), HasSubstr("frame_rate_hz"))));
}

TEST(TargetWireTest, ABoardHasItsPointsWithoutSayingThem) {
  v1::Target proto;
  proto.set_kind(v1::Target::KIND_RIGID);
  proto.set_board("board:checker,9x6,0.025");
  ASSERT_OK_AND_ASSIGN(const Target target, FromProto(proto));
  EXPECT_EQ(target, *ParseTarget("board:checker,9x6,0.025"));
  proto.set_board("board:checker,9x6");
  EXPECT_THAT(FromProto(proto),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("target.board")));
  proto.set_board("board:checker,8x6,0.025");
  EXPECT_THAT(FromProto(proto),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("turned by 180 degrees")));
  // Points that are given must be the board's.
  proto.set_board("board:checker,9x6,0.025");
  proto.add_points()->set_label("a");
  EXPECT_THAT(FromProto(proto), StatusIs(absl::StatusCode::kInvalidArgument,
                                         HasSubstr("its points are not those of")));
}

}  // namespace
}  // namespace rigcal::wire::camera_wire_test

// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <vector>

#include "agent/capture/metavision/metavision_device.h"
#include "tests/agent/capture/metavision/live_event_camera.h"
#include "tests/testing/fake_metavision/fake_event_camera.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::metavision_hal_device_test {
namespace {

using ::rigcal::testing::FakeBus;
using ::rigcal::testing::FakeEventCameraOptions;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr char kCalibration[] = R"(%YAML:1.0
---
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 500., 0., 320., 0., 500., 240., 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ 0., 0., 0., 0., 0. ]
)";

class MetavisionHalDeviceTest : public LiveEventCameraTest {};

TEST_F(MetavisionHalDeviceTest, DescribesTheCamera) {
  FakeBus::Get().Plug({});
  MetavisionSourceOptions options = Options();
  options.calibration_path = directory_.WriteFile("left.yaml", kCalibration).string();
  options.latency_s = 0.001;
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(options));
  const CameraDescription& description = source->description();
  EXPECT_EQ(description.camera, "left");
  EXPECT_EQ(description.image_size_px, (ImageSize{640, 480}));
  ASSERT_TRUE(description.intrinsics);
  EXPECT_EQ(description.clock, (Clock{.clock_id = "left", .timebase = ""}));
  EXPECT_EQ(description.latency_s, 0.001);
  EXPECT_EQ(description.sensor, SensorKind::kEvent);
  EXPECT_EQ(description.source, "metavision:00050423");
  ASSERT_TRUE(description.settings);
  EXPECT_EQ(description.settings->model, "Prophesee IMX636 00050423");
  EXPECT_EQ(description.settings->pixel_format, "EVT3");
  EXPECT_EQ(description.settings->trigger, "free");
}

TEST_F(MetavisionHalDeviceTest, CamerasOnOneCableShareAClock) {
  FakeBus::Get().Plug({});
  MetavisionSourceOptions options = Options();
  options.clock_id = "cable";
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(options));
  EXPECT_EQ(source->description().clock, (Clock{.clock_id = "cable", .timebase = ""}));
}

TEST_F(MetavisionHalDeviceTest, WithoutACameraSaysSo) {
  EXPECT_THAT(CreateStatus(Options()),
              StatusIs(absl::StatusCode::kNotFound,
                       AllOf(HasSubstr("camera left: there is no event camera"),
                             HasSubstr("found: none; is it plugged in"))));
}

TEST_F(MetavisionHalDeviceTest, TheSerialNumberChooses) {
  FakeBus::Get().Plug({.serial = "1"});
  FakeBus::Get().Plug({.serial = "2", .width = 1280, .height = 720});
  MetavisionSourceOptions options = Options();
  for (const std::string serial : {"2", "Prophesee:hal_plugin_prophesee:2"}) {
    options.serial = serial;
    ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(options));
    EXPECT_EQ(source->description().image_size_px, (ImageSize{1280, 720}));
    EXPECT_EQ(source->description().source, "metavision:2");
  }
  options.serial = "3";
  EXPECT_THAT(CreateStatus(options),
              StatusIs(absl::StatusCode::kNotFound,
                       AllOf(HasSubstr("camera left: there is no event camera 3; found: "),
                             HasSubstr("Prophesee:hal_plugin_prophesee:1, "),
                             HasSubstr("Prophesee:hal_plugin_prophesee:2"))));
  options.serial.clear();
  EXPECT_THAT(CreateStatus(options), StatusIs(absl::StatusCode::kFailedPrecondition,
                                              AllOf(HasSubstr("several event cameras"),
                                                    HasSubstr("name one with serial="))));
}

TEST_F(MetavisionHalDeviceTest, RefusesACalibrationForAnotherSize) {
  FakeBus::Get().Plug({.width = 1280, .height = 720});
  MetavisionSourceOptions options = Options();
  options.calibration_path = directory_.WriteFile("left.yaml", kCalibration).string();
  EXPECT_THAT(CreateStatus(options),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("1280x720"), HasSubstr("left.yaml is for 640x480"))));
  options.calibration_path = (directory_.path() / "none.yaml").string();
  EXPECT_THAT(CreateStatus(options),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("camera left: ")));
}

TEST_F(MetavisionHalDeviceTest, TakesEveryFormatThatCanBeDecoded) {
  struct Case {
    std::string format;
    std::string header;
    EventFormat expected;
    bool swapped;
  };
  for (const Case& c :
       {Case{"EVT2", "", EventFormat::kEvt2, false}, Case{"EVT3", "", EventFormat::kEvt3, false},
        Case{"EVT21", "", EventFormat::kEvt21, false},
        Case{"EVT3", "EVT3;height=480;width=640", EventFormat::kEvt3, false},
        // As drivers over MIPI tell it, and an IMX636 over USB.
        Case{"EVT3;height=480;width=640", "", EventFormat::kEvt3, false},
        Case{"EVT21", "EVT21;height=480;width=640;endianness=legacy", EventFormat::kEvt21, true}}) {
    FakeBus::Get().Reset();
    FakeBus::Get().Plug({.format = c.format,
                         .header_format = c.header,
                         .streams = {{.pieces = {std::vector<uint8_t>(16)}}}});
    ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(Options()));
    ASSERT_THAT(source->Start(target_), IsOk());
    ASSERT_OK_AND_ASSIGN(const auto chunk, source->Next());
    ASSERT_TRUE(chunk);
    EXPECT_EQ(chunk->format, c.expected) << c.format;
    EXPECT_EQ(chunk->halves_swapped, c.swapped) << c.header;
    EXPECT_EQ(chunk->bytes.size(), 16u);
  }
}

TEST_F(MetavisionHalDeviceTest, AsksForTheFormatOfTheFile) {
  const auto camera = FakeBus::Get().Plug({.format = "EVT21"});
  ASSERT_OK_AND_ASSIGN(const auto source,
                       MetavisionEventSource::Create(WithSettings("format = \"EVT3\"\n")));
  EXPECT_EQ(camera->options.format, "EVT3");
  EXPECT_EQ(source->description().settings->pixel_format, "EVT3");
}

TEST_F(MetavisionHalDeviceTest, ListsTheFormatsWhereItsOwnIsNotKnown) {
  FakeBus::Get().Plug({.format = "EVT4", .formats = {"EVT4", "AER-8b"}});
  EXPECT_THAT(CreateStatus(Options()),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("camera left: it sends events as \"EVT4\""),
                             HasSubstr("known: EVT2 (2.0), EVT21 (2.1), EVT3 (3.0)"),
                             HasSubstr("it offers: EVT4, AER-8b"))));
}

TEST_F(MetavisionHalDeviceTest, ACameraThatTellsTooLittleIsRefused) {
  for (const std::string facility : {"I_EventsStream", "I_Geometry", "I_HW_Identification"}) {
    FakeBus::Get().Reset();
    FakeBus::Get().Plug({.missing = {facility}});
    EXPECT_THAT(CreateStatus(Options()),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("camera left: it")));
  }
  FakeBus::Get().Reset();
  FakeBus::Get().Plug({.width = 0, .height = 480});
  EXPECT_THAT(CreateStatus(Options()),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("0x480 pixels")));
}

TEST_F(MetavisionHalDeviceTest, NoExceptionLeavesCreate) {
  for (const std::string function :
       {"open", "I_HW_Identification::get_serial", "I_AntiFlickerModule::enable",
        "I_TriggerIn::enable", "I_CameraSynchronization::set_mode_standalone",
        "I_ErcModule::set_cd_event_rate"}) {
    for (const bool odd : {false, true}) {
      FakeBus::Get().Reset();
      FakeEventCameraOptions camera;
      (odd ? camera.throwing_odd : camera.throwing).insert(function);
      FakeBus::Get().Plug(camera);
      EXPECT_THAT(CreateStatus(WithSettings("sync = \"standalone\"\ntrigger_in = [\"main\"]\n"
                                            "event_rate_limit = 2000\n")),
                  StatusIs(absl::StatusCode::kUnavailable,
                           AllOf(HasSubstr("camera left: cannot "), Not(HasSubstr("\n")),
                                 HasSubstr(odd ? "no exception of C++" : function + " failed"))))
          << function;
    }
  }
  FakeBus::Get().Reset();
  FakeBus::Get().list_throws = true;
  EXPECT_THAT(CreateStatus(Options()),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("cannot look for event cameras")));
}

}  // namespace
}  // namespace rigcal::agent::metavision_hal_device_test

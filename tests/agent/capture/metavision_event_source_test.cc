// SPDX-License-Identifier: Apache-2.0
// The source of live event cameras on a stand-in for the SDK (tests/testing/fake_metavision), built
// once in the way of its versions 4.x and once in that of 5.x.
#include "agent/capture/metavision_event_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <deque>
#include <future>
#include <memory>
#include <string>
#include <vector>

#include "agent/event/evt3_writer.h"
#include "tests/testing/fake_metavision/fake_event_camera.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent {
namespace {

using ::rigcal::testing::FakeBus;
using ::rigcal::testing::FakeEventCamera;
using ::rigcal::testing::FakeEventCameraOptions;
using ::rigcal::testing::FakeStream;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using Channel = Metavision::I_TriggerIn::Channel;

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

// Words of EVT 3.0 that tell times up to `until_us`.
std::vector<uint8_t> Evt3Words(int64_t from_us, int64_t until_us) {
  Evt3Writer writer;
  std::vector<uint8_t> bytes;
  for (int64_t time_us = from_us; time_us <= until_us; time_us += 1000) {
    writer.WriteTime(time_us, &bytes);
    const std::vector<CdEvent> events = {{.time_us = time_us, .x = 5, .y = 6, .on = true}};
    writer.Write(events, &bytes);
  }
  return bytes;
}

std::vector<uint8_t> Copy(std::span<const uint8_t> bytes) { return {bytes.begin(), bytes.end()}; }

class MetavisionEventSourceTest : public ::testing::Test {
 protected:
  MetavisionEventSourceTest() { FakeBus::Get().Reset(); }
  ~MetavisionEventSourceTest() override { FakeBus::Get().Reset(); }

  static MetavisionSourceOptions Options() {
    MetavisionSourceOptions options;
    options.camera = "left";
    options.shortest_pause = std::chrono::milliseconds(1);
    options.longest_pause = std::chrono::milliseconds(2);
    return options;
  }

  // With a file of settings.
  MetavisionSourceOptions WithSettings(const std::string& toml) {
    MetavisionSourceOptions options = Options();
    options.settings_path = directory_.WriteFile("biases.toml", toml).string();
    return options;
  }

  static absl::Status CreateStatus(const MetavisionSourceOptions& options) {
    return MetavisionEventSource::Create(options).status();
  }

  testing::TemporaryDirectory directory_;
  const Target target_;
};

TEST_F(MetavisionEventSourceTest, DescribesTheCamera) {
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

TEST_F(MetavisionEventSourceTest, CamerasOnOneCableShareAClock) {
  FakeBus::Get().Plug({});
  MetavisionSourceOptions options = Options();
  options.clock_id = "cable";
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(options));
  EXPECT_EQ(source->description().clock, (Clock{.clock_id = "cable", .timebase = ""}));
}

TEST_F(MetavisionEventSourceTest, WithoutACameraSaysSo) {
  EXPECT_THAT(CreateStatus(Options()),
              StatusIs(absl::StatusCode::kNotFound,
                       AllOf(HasSubstr("camera left: there is no event camera"),
                             HasSubstr("found: none; is it plugged in"))));
}

TEST_F(MetavisionEventSourceTest, TheSerialNumberChooses) {
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

TEST_F(MetavisionEventSourceTest, RefusesACalibrationForAnotherSize) {
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

TEST_F(MetavisionEventSourceTest, TakesEveryFormatThatCanBeDecoded) {
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

TEST_F(MetavisionEventSourceTest, AsksForTheFormatOfTheFile) {
  const auto camera = FakeBus::Get().Plug({.format = "EVT21"});
  ASSERT_OK_AND_ASSIGN(const auto source,
                       MetavisionEventSource::Create(WithSettings("format = \"EVT3\"\n")));
  EXPECT_EQ(camera->options.format, "EVT3");
  EXPECT_EQ(source->description().settings->pixel_format, "EVT3");
}

TEST_F(MetavisionEventSourceTest, ListsTheFormatsWhereItsOwnIsNotKnown) {
  FakeBus::Get().Plug({.format = "EVT4", .formats = {"EVT4", "AER-8b"}});
  EXPECT_THAT(CreateStatus(Options()),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("camera left: it sends events as \"EVT4\""),
                             HasSubstr("known: EVT2 (2.0), EVT21 (2.1), EVT3 (3.0)"),
                             HasSubstr("it offers: EVT4, AER-8b"))));
}

TEST_F(MetavisionEventSourceTest, SetsWhatTheFileSays) {
  const auto camera = FakeBus::Get().Plug({.inputs = {{Channel::Main, 0}, {Channel::Aux, 1}}});
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(WithSettings(R"(
sync = "standalone"
trigger_in = ["main", "aux"]
event_rate_limit = 20_000_000
[biases]
bias_fo = -35
bias_hpf = 20
)")));
  EXPECT_EQ(camera->options.biases["bias_fo"].value, -35);
  EXPECT_EQ(camera->options.biases["bias_hpf"].value, 20);
  EXPECT_EQ(camera->rate_limit, 20'000'000u);
  EXPECT_FALSE(camera->anti_flicker);
  EXPECT_THAT(camera->calls, ElementsAre("set_mode_standalone", "bias_fo", "bias_hpf",
                                         "enable input 0", "enable input 1", "limit rate"));
  EXPECT_EQ(source->description().settings->trigger, "main, aux");
  EXPECT_EQ(camera->starts, 0);
}

TEST_F(MetavisionEventSourceTest, WithoutAFileOnlySwitchesAntiFlickerOff) {
  const auto camera = FakeBus::Get().Plug({});
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(Options()));
  EXPECT_THAT(camera->calls, IsEmpty());
  EXPECT_FALSE(camera->anti_flicker);
}

TEST_F(MetavisionEventSourceTest, TellsBiasesThatTheCameraDoesNotTake) {
  FakeBus::Get().Plug({.biases = {{"bias_fo", {3, -35, 55, true}},
                                  {"bias_refr", {0, -20, 235, true}},
                                  {"bias_diff", {0, -25, 23, false}}}});
  EXPECT_THAT(CreateStatus(WithSettings(R"([biases]
bias_diff = 1
bias_fo = 56
bias_pr = 0
)")),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("camera left: bias bias_diff cannot be changed"),
                             HasSubstr("bias bias_fo is to be 56, but the camera offers -35 to 55"),
                             HasSubstr("there is no bias bias_pr; the camera has: bias_diff = 0, "
                                       "bias_fo = 3, bias_refr = 0"))));
}

TEST_F(MetavisionEventSourceTest, BiasesMayBeMissingRefusedOrThrow) {
  const std::string toml = "[biases]\nbias_fo = 1\n";
  FakeBus::Get().Plug({.missing = {"I_LL_Biases"}});
  EXPECT_THAT(CreateStatus(WithSettings(toml)),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("no biases to set")));
  FakeBus::Get().Reset();
  FakeBus::Get().Plug({.refusing = {"I_LL_Biases::set"}});
  EXPECT_THAT(CreateStatus(WithSettings(toml)),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("did not take bias bias_fo")));
  FakeBus::Get().Reset();
  FakeBus::Get().Plug({.throwing = {"I_LL_Biases::set"}});
  // The SDK's ruled lines have become one.
  EXPECT_THAT(CreateStatus(WithSettings(toml)),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       "camera left: cannot set bias bias_fo: Metavision HAL exception Error: "
                       "I_LL_Biases::set failed"));
}

TEST_F(MetavisionEventSourceTest, TellsTriggerInputsThatAreNotThere) {
  FakeBus::Get().Plug({.inputs = {{Channel::Main, 0}, {Channel::Loopback, 6}}});
  EXPECT_THAT(CreateStatus(WithSettings("trigger_in = [\"aux\"]\n")),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("no trigger input aux"),
                             HasSubstr("it has: main (channel 0), loopback (channel 6)"))));
  MetavisionSourceOptions options = WithSettings("trigger_in = [\"main\"]\n");
  options.trigger_channel = 6;
  EXPECT_THAT(CreateStatus(options),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("trigger_channel=6, but what is listened to is main")));
  options.trigger_channel = 0;
  EXPECT_THAT(CreateStatus(options), IsOk());
  FakeBus::Get().Reset();
  FakeBus::Get().Plug({.missing = {"I_TriggerIn"}});
  EXPECT_THAT(CreateStatus(options),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("has no trigger inputs")));
  FakeBus::Get().Reset();
  FakeBus::Get().Plug({.refusing = {"I_TriggerIn::enable"}});
  EXPECT_THAT(CreateStatus(options), StatusIs(absl::StatusCode::kInvalidArgument,
                                              HasSubstr("did not switch trigger input main on")));
}

TEST_F(MetavisionEventSourceTest, ListensToTheMainInputWhereTriggersAreUsed) {
  const auto camera = FakeBus::Get().Plug({});
  MetavisionSourceOptions options = Options();
  options.uses_triggers = true;
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(options));
  EXPECT_THAT(camera->calls, ElementsAre("enable input 0"));
  EXPECT_EQ(source->description().settings->trigger, "main");
}

TEST_F(MetavisionEventSourceTest, SetsHowClocksGoTogether) {
  for (const auto& [sync, call] : {std::pair{EventCameraSync::kStandalone, "set_mode_standalone"},
                                   std::pair{EventCameraSync::kPrimary, "set_mode_master"},
                                   std::pair{EventCameraSync::kSecondary, "set_mode_slave"}}) {
    FakeBus::Get().Reset();
    const auto camera = FakeBus::Get().Plug({});
    MetavisionSourceOptions options = WithSettings("sync = \"standalone\"\n");
    options.sync = sync;  // goes before the file
    ASSERT_THAT(CreateStatus(options), IsOk());
    EXPECT_THAT(camera->calls, ElementsAre(call));
  }
  MetavisionSourceOptions options = Options();
  options.sync = EventCameraSync::kPrimary;
  FakeBus::Get().Reset();
  FakeBus::Get().Plug({.refusing = {"I_CameraSynchronization::set_mode_master"}});
  EXPECT_THAT(CreateStatus(options), StatusIs(absl::StatusCode::kInvalidArgument,
                                              HasSubstr("did not take sync = \"primary\"")));
  FakeBus::Get().Reset();
  FakeBus::Get().Plug({.missing = {"I_CameraSynchronization"}});
  EXPECT_THAT(CreateStatus(options), StatusIs(absl::StatusCode::kInvalidArgument,
                                              HasSubstr("camera cannot be synchronised")));
  options.sync = EventCameraSync::kStandalone;
  EXPECT_THAT(CreateStatus(options), IsOk());
}

TEST_F(MetavisionEventSourceTest, LimitsEventsAsFarAsTheCameraCan) {
  const auto camera = FakeBus::Get().Plug({.lowest_rate = 1000, .highest_rate = 50'000});
  EXPECT_THAT(CreateStatus(WithSettings("event_rate_limit = 50001\n")),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("50001 events/s, but the camera offers 1000 to 50000")));
  EXPECT_THAT(CreateStatus(WithSettings("event_rate_limit = 999\n")),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("1000 to 50000")));
  EXPECT_THAT(CreateStatus(WithSettings("event_rate_limit = 1000\n")), IsOk());
  EXPECT_EQ(camera->rate_limit, 1000u);
  EXPECT_THAT(CreateStatus(WithSettings("event_rate_limit = 0\n")), IsOk());
  EXPECT_FALSE(camera->rate_limit);
  camera->options.missing = {"I_ErcModule"};
  EXPECT_THAT(CreateStatus(WithSettings("event_rate_limit = 0\n")), IsOk());
  EXPECT_THAT(CreateStatus(WithSettings("event_rate_limit = 1000\n")),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("cannot limit its events")));
}

TEST_F(MetavisionEventSourceTest, RefusesAnAntiFlickerThatStaysOn) {
  const auto camera = FakeBus::Get().Plug({.refusing = {"I_AntiFlickerModule::enable"}});
  EXPECT_THAT(CreateStatus(Options()),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("anti-flicker")));
  camera->options.missing = {"I_AntiFlickerModule"};
  EXPECT_THAT(CreateStatus(Options()), IsOk());
}

TEST_F(MetavisionEventSourceTest, ACameraThatTellsTooLittleIsRefused) {
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

TEST_F(MetavisionEventSourceTest, NoExceptionLeavesCreate) {
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

TEST_F(MetavisionEventSourceTest, TellsTheStreamAsItCame) {
  const std::vector<uint8_t> words = Evt3Words(0, 20'000);
  const std::vector<uint8_t> first(words.begin(), words.begin() + 41);  // within a word
  const std::vector<uint8_t> second(words.begin() + 41, words.begin() + 42);
  const std::vector<uint8_t> third(words.begin() + 42, words.end());
  const auto camera = FakeBus::Get().Plug({.streams = {{.pieces = {first, second, third}}}});
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(Options()));
  ASSERT_THAT(source->Start(target_), IsOk());
  std::vector<uint8_t> told;
  while (told.size() < words.size()) {
    ASSERT_OK_AND_ASSIGN(const auto chunk, source->Next());
    ASSERT_TRUE(chunk);
    EXPECT_EQ(chunk->bytes.size() % 2, 0u);
    EXPECT_EQ(chunk->byte_offset, told.size());
    EXPECT_FALSE(chunk->clock_began_anew);
    told.insert(told.end(), chunk->bytes.begin(), chunk->bytes.end());
  }
  EXPECT_EQ(told, words);
  EXPECT_THAT(source->Refused(), IsEmpty());
}

TEST_F(MetavisionEventSourceTest, CutsLargeBuffers) {
  std::vector<uint8_t> words((size_t{5} << 19) + 6);
  for (size_t i = 0; i < words.size(); ++i) words[i] = static_cast<uint8_t>(i * 7 >> 3);
  FakeBus::Get().Plug({.streams = {{.pieces = {words}}}});
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(Options()));
  ASSERT_THAT(source->Start(target_), IsOk());
  std::vector<uint8_t> told;
  for (const size_t size : {size_t{1} << 20, size_t{1} << 20, (size_t{1} << 19) + 6}) {
    ASSERT_OK_AND_ASSIGN(const auto chunk, source->Next());
    ASSERT_EQ(chunk->bytes.size(), size);
    told.insert(told.end(), chunk->bytes.begin(), chunk->bytes.end());
  }
  EXPECT_EQ(told, words);
}

TEST_F(MetavisionEventSourceTest, StartsAndStopsAgain) {
  const auto camera = FakeBus::Get().Plug(
      {.streams = {{.pieces = {{1, 2}}}, {.pieces = {{3, 4}, {5, 6}}}, {.pieces = {{7, 8}}}}});
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(Options()));
  ASSERT_OK_AND_ASSIGN(const auto before, source->Next());
  EXPECT_FALSE(before);
  EXPECT_EQ(camera->starts, 0);
  for (const int begin : {1, 3}) {
    ASSERT_THAT(source->Start(target_), IsOk());
    ASSERT_OK_AND_ASSIGN(const auto chunk, source->Next());
    ASSERT_TRUE(chunk);
    EXPECT_EQ(chunk->bytes[0], begin);
    EXPECT_EQ(chunk->byte_offset, 0u);
    EXPECT_TRUE(camera->streaming);
    source->Stop();
    for (int i = 0; i < 2; ++i) {
      ASSERT_OK_AND_ASSIGN(const auto none, source->Next());
      EXPECT_FALSE(none);
    }
    EXPECT_FALSE(camera->streaming);
  }
  // Without a stop in between.
  ASSERT_THAT(source->Start(target_), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto chunk, source->Next());
  EXPECT_THAT(Copy(chunk->bytes), ElementsAre(7, 8));
  ASSERT_THAT(source->Start(target_), IsOk());
  EXPECT_EQ(camera->starts, 3);
  EXPECT_EQ(camera->stops, 3);
}

TEST_F(MetavisionEventSourceTest, TheLastPieceStaysUntilTheNextAfterAStop) {
  // 4.x spoils what it showed as soon as its stream is stopped.
  FakeBus::Get().Plug({.streams = {{.pieces = {{1, 2, 3, 4}}}}});
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(Options()));
  ASSERT_THAT(source->Start(target_), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto chunk, source->Next());
  std::async(std::launch::async, [&] { source->Stop(); }).get();
  EXPECT_THAT(Copy(chunk->bytes), ElementsAre(1, 2, 3, 4));
}

TEST_F(MetavisionEventSourceTest, StopEndsTheWaitForEvents) {
  const auto camera = FakeBus::Get().Plug({});
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(Options()));
  for (int round = 0; round < 3; ++round) {
    ASSERT_THAT(source->Start(target_), IsOk());
    const int polls = camera->polls_in_vain;
    auto next = std::async(std::launch::async, [&] { return source->Next(); });
    camera->WaitUntil(&FakeEventCamera::polls_in_vain, polls + 1);
    source->Stop();
    ASSERT_OK_AND_ASSIGN(const auto chunk, next.get());
    EXPECT_FALSE(chunk);
    EXPECT_FALSE(camera->streaming);
  }
}

TEST_F(MetavisionEventSourceTest, StopEndsTheSearchForALostCamera) {
  const auto camera = FakeBus::Get().Plug({.streams = {{.then = FakeStream::Then::kEnd}}});
  MetavisionSourceOptions options = Options();
  options.shortest_pause = std::chrono::hours(1);
  options.longest_pause = std::chrono::hours(1);
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(options));
  ASSERT_THAT(source->Start(target_), IsOk());
  auto next = std::async(std::launch::async, [&] { return source->Next(); });
  camera->WaitUntil(&FakeEventCamera::stops, 1);
  source->Stop();
  ASSERT_OK_AND_ASSIGN(const auto chunk, next.get());
  EXPECT_FALSE(chunk);
}

TEST_F(MetavisionEventSourceTest, FindsALostCameraAgain) {
  for (const auto then : {FakeStream::Then::kEnd, FakeStream::Then::kThrow}) {
    FakeBus::Get().Reset();
    const auto camera = FakeBus::Get().Plug(
        {.streams = {{.pieces = {{1, 2, 3}}, .then = then}, {.pieces = {{4, 5}, {6, 7}}}}});
    FakeBus::Get().Plug({.serial = "another"});
    MetavisionSourceOptions options = WithSettings("[biases]\nbias_fo = 7\n");
    options.serial = "00050423";
    ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(options));
    ASSERT_THAT(source->Start(target_), IsOk());
    ASSERT_OK_AND_ASSIGN(const auto before, source->Next());
    EXPECT_THAT(Copy(before->bytes), ElementsAre(1, 2));
    camera->options.biases["bias_fo"].value = 0;  // forgotten without power
    FakeBus::Get().absences = 3;
    ASSERT_OK_AND_ASSIGN(const auto after, source->Next());
    ASSERT_TRUE(after);
    // Half a word of before is not joined with what came after.
    EXPECT_THAT(Copy(after->bytes), ElementsAre(4, 5));
    EXPECT_EQ(after->byte_offset, 2u);
    EXPECT_TRUE(after->clock_began_anew);
    ASSERT_OK_AND_ASSIGN(const auto last, source->Next());
    EXPECT_FALSE(last->clock_began_anew);
    EXPECT_EQ(camera->options.biases["bias_fo"].value, 7);
    EXPECT_THAT(FakeBus::Get().opened,
                ElementsAre("00050423", "00050423", "00050423", "00050423", "00050423"));
    EXPECT_THAT(source->Refused(), ElementsAre(AllOf(Field(&Refusal::reason, "camera_lost"),
                                                     Field(&Refusal::count, 1u))));
    // The next capture begins without it.
    ASSERT_THAT(source->Start(target_), IsOk());
    EXPECT_THAT(source->Refused(), IsEmpty());
  }
}

TEST_F(MetavisionEventSourceTest, TheOnlyCameraIsLookedForByItsName) {
  FakeBus::Get().Plug({.streams = {{.then = FakeStream::Then::kEnd}, {.pieces = {{1, 2}}}}});
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(Options()));
  FakeBus::Get().Plug({.serial = "another"});
  ASSERT_THAT(source->Start(target_), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto chunk, source->Next());
  ASSERT_TRUE(chunk);
  const std::string name = "Prophesee:hal_plugin_prophesee:00050423";
  EXPECT_THAT(FakeBus::Get().opened, ElementsAre(name, name));
}

TEST_F(MetavisionEventSourceTest, AStreamThatCannotBeginIsACameraLost) {
  const auto camera = FakeBus::Get().Plug({.streams = {{.pieces = {{1, 2}}}}});
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(Options()));
  camera->options.throwing = {"I_EventsStream::start"};
  ASSERT_THAT(source->Start(target_), IsOk());
  auto next = std::async(std::launch::async, [&] { return source->Next(); });
  camera->WaitUntil(&FakeEventCamera::starts, 3);
  source->Stop();
  ASSERT_OK_AND_ASSIGN(const auto none, next.get());
  EXPECT_FALSE(none);
  camera->options.throwing.clear();
  ASSERT_THAT(source->Start(target_), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto chunk, source->Next());
  EXPECT_THAT(Copy(chunk->bytes), ElementsAre(1, 2));
}

TEST_F(MetavisionEventSourceTest, ExceptionsOfTheStreamAreACameraLost) {
  for (const std::string function :
       {"I_EventsStream::poll_buffer", "I_EventsStream::get_latest_raw_data"}) {
    for (const bool odd : {false, true}) {
      FakeBus::Get().Reset();
      const auto camera =
          FakeBus::Get().Plug({.streams = std::deque<FakeStream>(100, {.pieces = {{1, 2}}})});
      ASSERT_OK_AND_ASSIGN(auto source, MetavisionEventSource::Create(Options()));
      (odd ? camera->options.throwing_odd : camera->options.throwing) = {function};
      // Found again, and lost again, until it is stopped.
      ASSERT_THAT(source->Start(target_), IsOk());
      auto next = std::async(std::launch::async, [&] { return source->Next(); });
      camera->WaitUntil(&FakeEventCamera::starts, 3);
      source->Stop();
      ASSERT_OK_AND_ASSIGN(const auto none, next.get());
      EXPECT_FALSE(none);
    }
  }
}

TEST_F(MetavisionEventSourceTest, ExceptionsAtTheEndStayInside) {
  const auto camera = FakeBus::Get().Plug({.streams = {{.pieces = {{1, 2}}}}});
  ASSERT_OK_AND_ASSIGN(auto source, MetavisionEventSource::Create(Options()));
  ASSERT_THAT(source->Start(target_), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto chunk, source->Next());
  ASSERT_TRUE(chunk);
  camera->options.throwing_odd = {"I_EventsStream::stop"};
  source.reset();
  EXPECT_EQ(camera->stops, 1);
}

TEST_F(MetavisionEventSourceTest, AnotherSensorDoesNotTakeTheLostOnesPlace) {
  const auto camera = FakeBus::Get().Plug({.streams = {{.then = FakeStream::Then::kEnd}}});
  ASSERT_OK_AND_ASSIGN(auto source, MetavisionEventSource::Create(Options()));
  camera->options.width = 1280;
  ASSERT_THAT(source->Start(target_), IsOk());
  auto next = std::async(std::launch::async, [&] { return source->Next(); });
  camera->WaitUntil(&FakeEventCamera::opens, 4);
  source->Stop();
  ASSERT_OK_AND_ASSIGN(const auto none, next.get());
  EXPECT_FALSE(none);
  EXPECT_EQ(camera->starts, 1);
}

TEST_F(MetavisionEventSourceTest, PausesGrowToTheLongest) {
  MetavisionSourceOptions options;
  std::vector<int64_t> pauses_ms;
  for (auto pause = options.shortest_pause; pauses_ms.size() < 7;
       pause = MetavisionEventSource::NextPause(pause, options)) {
    pauses_ms.push_back(pause.count());
  }
  EXPECT_THAT(pauses_ms, ElementsAre(200, 400, 800, 1600, 3200, 5000, 5000));
}

TEST_F(MetavisionEventSourceTest, APrimaryWaitsForThoseThatFollowIt) {
  const auto camera = FakeBus::Get().Plug({});
  MetavisionSourceOptions options = Options();
  options.sync = EventCameraSync::kPrimary;
  options.primary_delay_s = 60;
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(options));
  ASSERT_THAT(source->Start(target_), IsOk());
  auto next = std::async(std::launch::async, [&] { return source->Next(); });
  source->Stop();
  ASSERT_OK_AND_ASSIGN(const auto none, next.get());
  EXPECT_FALSE(none);
  EXPECT_EQ(camera->starts, 0);
}

TEST_F(MetavisionEventSourceTest, ComparesTheSensorsClockWithTheHosts) {
  FakeBus::Get().Plug({.streams = {{.pieces = {Evt3Words(0, 10'000), Evt3Words(11'000, 30'000)}}}});
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(Options()));
  ASSERT_THAT(source->Start(target_), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto first, source->Next());
  ASSERT_TRUE(first);
  // What is told of the time before the piece leaves before its sample.
  EXPECT_THAT(source->TakeClockSamples(), IsEmpty());
  ASSERT_OK_AND_ASSIGN(const auto second, source->Next());
  ASSERT_TRUE(second);
  EXPECT_THAT(source->TakeClockSamples(),
              ElementsAre(AllOf(Field(&ClockSample::device_ns, 10'000'000),
                                Field(&ClockSample::uncertainty_ns, 5'000'000u))));
  EXPECT_THAT(source->TakeClockSamples(), IsEmpty());
}

TEST_F(MetavisionEventSourceTest, ASecondaryThatWaitsForItsPrimaryHasNoTime) {
  FakeBus::Get().Plug(
      {.streams = {{.pieces = {Evt3Words(0, 0), Evt3Words(0, 0), Evt3Words(0, 5000), {0, 0}}}}});
  MetavisionSourceOptions options = Options();
  options.sync = EventCameraSync::kSecondary;
  options.clock_id = "cable";
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(options));
  ASSERT_THAT(source->Start(target_), IsOk());
  for (int i = 0; i < 3; ++i) {
    ASSERT_OK_AND_ASSIGN(const auto chunk, source->Next());
    ASSERT_TRUE(chunk);
    EXPECT_THAT(source->TakeClockSamples(), IsEmpty());
  }
  ASSERT_OK_AND_ASSIGN(const auto chunk, source->Next());
  ASSERT_TRUE(chunk);
  EXPECT_THAT(source->TakeClockSamples(), ElementsAre(Field(&ClockSample::device_ns, 5'000'000)));
}

TEST_F(MetavisionEventSourceTest, ClockSamplesAreOfTheTimeSinceTheCameraIsBack) {
  FakeBus::Get().Plug(
      {.streams = {{.pieces = {Evt3Words(0, 50'000)}, .then = FakeStream::Then::kEnd},
                   {.pieces = {Evt3Words(0, 7000), {0, 0}}}}});
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(Options()));
  ASSERT_THAT(source->Start(target_), IsOk());
  for (int i = 0; i < 3; ++i) {
    ASSERT_OK_AND_ASSIGN(const auto chunk, source->Next());
    ASSERT_TRUE(chunk);
  }
  EXPECT_THAT(source->TakeClockSamples(), ElementsAre(Field(&ClockSample::device_ns, 7'000'000)));
}

TEST_F(MetavisionEventSourceTest, OptionsThatMakeNoSense) {
  MetavisionSourceOptions options;
  options.primary_delay_s = std::nan("");
  options.latency_s = 11;
  options.trigger_channel = 32;
  options.shortest_pause = std::chrono::milliseconds(0);
  EXPECT_THAT(CreateStatus(options),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("name is empty"), HasSubstr("primary_delay is nan"),
                             HasSubstr("latency is 11"), HasSubstr("trigger_channel is 32"),
                             HasSubstr("shortest pause"))));
  EXPECT_THAT(CreateStatus(WithSettings("colour = 1\n")),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("camera left: "), HasSubstr("unknown key colour"))));
}

TEST_F(MetavisionEventSourceTest, ListsWhatIsThere) {
  FakeBus::Get().Plug({.serial = "1"});
  ASSERT_OK_AND_ASSIGN(const auto found, ListMetavisionDevices());
  EXPECT_THAT(found, ElementsAre("Prophesee:hal_plugin_prophesee:1"));
}

}  // namespace
}  // namespace rigcal::agent

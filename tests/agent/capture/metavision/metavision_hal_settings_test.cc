// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/metavision/metavision_hal_settings.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <utility>

#include "tests/agent/capture/metavision/live_event_camera.h"
#include "tests/testing/fake_metavision/fake_event_camera.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::metavision_hal_settings_test {
namespace {

using ::rigcal::testing::FakeBus;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using Channel = Metavision::I_TriggerIn::Channel;

class MetavisionHalSettingsTest : public LiveEventCameraTest {};

TEST_F(MetavisionHalSettingsTest, SetsWhatTheFileSays) {
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

TEST_F(MetavisionHalSettingsTest, WithoutAFileOnlySwitchesAntiFlickerOff) {
  const auto camera = FakeBus::Get().Plug({});
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(Options()));
  EXPECT_THAT(camera->calls, IsEmpty());
  EXPECT_FALSE(camera->anti_flicker);
}

TEST_F(MetavisionHalSettingsTest, TellsBiasesThatTheCameraDoesNotTake) {
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

TEST_F(MetavisionHalSettingsTest, BiasesMayBeMissingRefusedOrThrow) {
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

TEST_F(MetavisionHalSettingsTest, TellsTriggerInputsThatAreNotThere) {
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

TEST_F(MetavisionHalSettingsTest, ListensToTheMainInputWhereTriggersAreUsed) {
  const auto camera = FakeBus::Get().Plug({});
  MetavisionSourceOptions options = Options();
  options.uses_triggers = true;
  ASSERT_OK_AND_ASSIGN(const auto source, MetavisionEventSource::Create(options));
  EXPECT_THAT(camera->calls, ElementsAre("enable input 0"));
  EXPECT_EQ(source->description().settings->trigger, "main");
}

TEST_F(MetavisionHalSettingsTest, SetsHowClocksGoTogether) {
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

TEST_F(MetavisionHalSettingsTest, LimitsEventsAsFarAsTheCameraCan) {
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

TEST_F(MetavisionHalSettingsTest, RefusesAnAntiFlickerThatStaysOn) {
  const auto camera = FakeBus::Get().Plug({.refusing = {"I_AntiFlickerModule::enable"}});
  EXPECT_THAT(CreateStatus(Options()),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("anti-flicker")));
  camera->options.missing = {"I_AntiFlickerModule"};
  EXPECT_THAT(CreateStatus(Options()), IsOk());
}

}  // namespace
}  // namespace rigcal::agent::metavision_hal_settings_test

// SPDX-License-Identifier: Apache-2.0
#include "common/config/event_camera_config.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::event_camera_config_test {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pair;

class EventCameraConfigTest : public ::testing::Test {
 protected:
  absl::StatusOr<EventCameraConfig> Read(const std::string& text) {
    return ReadEventCameraConfig(directory_.WriteFile("biases.toml", text).string());
  }
  TemporaryDirectory directory_;
};

TEST_F(EventCameraConfigTest, AnEmptyFileChangesNothing) {
  ASSERT_OK_AND_ASSIGN(const EventCameraConfig config, Read(""));
  EXPECT_EQ(config.format, "");
  EXPECT_FALSE(config.sync);
  EXPECT_THAT(config.trigger_in, IsEmpty());
  EXPECT_FALSE(config.event_rate_limit);
  EXPECT_THAT(config.biases, IsEmpty());
}

TEST_F(EventCameraConfigTest, TakesEveryKey) {
  ASSERT_OK_AND_ASSIGN(const EventCameraConfig config, Read(R"(
format = "EVT21"
sync = "secondary"
trigger_in = ["main", "aux", "main"]
event_rate_limit = 20_000_000
[biases]
bias_fo = -10
bias_diff_on = 40
)"));
  EXPECT_EQ(config.format, "EVT21");
  EXPECT_EQ(config.sync, EventCameraSync::kSecondary);
  EXPECT_THAT(config.trigger_in, ElementsAre("main", "aux"));
  EXPECT_EQ(config.event_rate_limit, 20'000'000);
  EXPECT_THAT(config.biases, ElementsAre(Pair("bias_diff_on", 40), Pair("bias_fo", -10)));
}

TEST_F(EventCameraConfigTest, TellsEveryFaultWithItsLine) {
  EXPECT_THAT(
      Read(R"(format = "EVT4"
sync = "master"
trigger_in = ["main", "left", 3]
event_rate_limit = -1
colour = "red"
[biases]
bias_fo = 1.5
bias_hpf = 99999999999
)"),
      StatusIs(absl::StatusCode::kInvalidArgument,
               AllOf(HasSubstr("biases.toml:1: format=EVT4 must be EVT2, EVT21 or EVT3"),
                     HasSubstr("biases.toml:2: sync=master must be standalone, primary or"),
                     HasSubstr("biases.toml:3: trigger_in must hold main, aux, loopback, not left"),
                     HasSubstr("biases.toml:3: trigger_in must hold main, aux, loopback, not this"),
                     HasSubstr("biases.toml:4: event_rate_limit=-1 must be a whole number of 0"),
                     HasSubstr("biases.toml:5: unknown key \"colour\""),
                     HasSubstr("biases.toml:7: bias_fo must be a whole number"),
                     HasSubstr("biases.toml:8: bias_hpf must be a whole number"))));
}

TEST_F(EventCameraConfigTest, TellsWhatIsWrittenInAnotherForm) {
  EXPECT_THAT(Read("trigger_in = \"main\"\nbiases = 3\nevent_rate_limit = 4294967296\n"),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("biases.toml:1: trigger_in must be a list"),
                             HasSubstr("biases.toml:2: biases must be a table: [biases]"),
                             HasSubstr("biases.toml:3: event_rate_limit=4294967296 must be"))));
}

TEST_F(EventCameraConfigTest, RefusesWhatIsNoFileAndNoToml) {
  EXPECT_THAT(ReadEventCameraConfig((directory_.path() / "none.toml").string()),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("none.toml")));
  EXPECT_THAT(Read("biases = ["),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("biases.toml:1: ")));
}

TEST(EventCameraSync, EachHasAName) {
  EXPECT_EQ(EventCameraSyncName(EventCameraSync::kStandalone), "standalone");
  EXPECT_EQ(EventCameraSyncName(EventCameraSync::kPrimary), "primary");
  EXPECT_EQ(EventCameraSyncName(EventCameraSync::kSecondary), "secondary");
}

}  // namespace
}  // namespace rigcal::testing::event_camera_config_test

// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "agent/capture/event_source_spec.h"
#include "agent/capture/metavision/metavision_device.h"
#include "agent/capture/metavision/metavision_options.h"
#include "agent/capture/registry/source_registry.h"
#include "common/config/agent_config.h"
#include "tests/agent/capture/source_options_of.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::metavision_source_kind_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;

struct Parsed {
  MetavisionSourceOptions options;
  BlinkWandDetectorOptions detector;
};

absl::StatusOr<Parsed> Parse(const std::string& text) {
  const auto spec = ParseSourceSpec(text);
  if (!spec.ok()) return spec.status();
  return Parsed{OptionsOf<MetavisionSourceOptions>(**spec),
                dynamic_cast<const EventSourceSpec&>(**spec).detector};
}

TEST(MetavisionSourceKind, TakesEveryOption) {
  ASSERT_OK_AND_ASSIGN(
      const Parsed parsed,
      Parse("left=metavision:serial=00050423;biases=biases.toml;sync=primary;primary_delay=2.5;"
            "clock=cable;latency=0.0001;calibration=left.yaml;rate=250;trigger=middle;"
            "trigger_channel=0;band=0.2"));
  EXPECT_EQ(parsed.options.camera, "left");
  EXPECT_EQ(parsed.options.serial, "00050423");
  EXPECT_EQ(parsed.options.settings_path, "biases.toml");
  EXPECT_EQ(parsed.options.sync, EventCameraSync::kPrimary);
  EXPECT_EQ(parsed.options.primary_delay_s, 2.5);
  EXPECT_EQ(parsed.options.clock_id, "cable");
  EXPECT_EQ(parsed.options.latency_s, 0.0001);
  EXPECT_EQ(parsed.options.calibration_path, "left.yaml");
  EXPECT_TRUE(parsed.options.uses_triggers);
  EXPECT_EQ(parsed.options.trigger_channel, 0);
  EXPECT_EQ(parsed.detector.output.rate_hz, 250);
  EXPECT_EQ(parsed.detector.output.trigger, TriggerInstant::kMiddle);
  EXPECT_EQ(parsed.detector.band_rel, 0.2);
}

TEST(MetavisionSourceKind, NeedsNothing) {
  ASSERT_OK_AND_ASSIGN(const Parsed parsed, Parse("metavision:"));
  EXPECT_EQ(parsed.options.camera, "metavision");
  EXPECT_EQ(parsed.options.serial, "");
  EXPECT_EQ(parsed.options.calibration_path, "");
  EXPECT_FALSE(parsed.options.sync);
  EXPECT_FALSE(parsed.options.uses_triggers);
  EXPECT_EQ(parsed.detector.output.rate_hz, 200);
}

TEST(MetavisionSourceKind, IsNamedAfterTheSerialNumber) {
  ASSERT_OK_AND_ASSIGN(const Parsed plain, Parse("metavision:serial=00050423"));
  EXPECT_EQ(plain.options.camera, "00050423");
  ASSERT_OK_AND_ASSIGN(const Parsed full,
                       Parse("metavision:serial=Prophesee:hal_plugin_prophesee:00050423;"
                             "calibration=none"));
  EXPECT_EQ(full.options.camera, "00050423");
  EXPECT_EQ(full.options.calibration_path, "");
}

TEST(MetavisionSourceKind, TellsEveryFault) {
  EXPECT_THAT(Parse("left=metavision:sync=master;primary_delay=61;speed=max;rate=0"),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("sync=master must be standalone, primary or secondary"),
                             HasSubstr("primary_delay=61 must be a number of 0 to 60 s"),
                             HasSubstr("unknown option \"speed\""),
                             HasSubstr("example: left=metavision:serial="))));
  EXPECT_THAT(
      Parse("metavision:00050423"),
      StatusIs(absl::StatusCode::kInvalidArgument,
               AllOf(HasSubstr("\"00050423\" is not KEY=VALUE"), HasSubstr("metavision:serial="))));
}

TEST(MetavisionSourceKind, IsReadFromAConfiguration) {
  const testing::TemporaryDirectory directory;
  const std::string path = directory
                               .WriteFile("agent.toml", R"([[camera]]
name = "left"
source = "metavision:serial=00050423"
[camera.settings]
biases = "left_biases.toml"
clock = "cable"
[camera.detector]
trigger = "rising"
)")
                               .string();
  ASSERT_OK_AND_ASSIGN(const AgentConfig config, ReadAgentConfig(path));
  ASSERT_EQ(config.cameras.size(), 1u);
  ASSERT_OK_AND_ASSIGN(const auto spec, ParseSourceSpec(config.cameras[0]));
  EXPECT_EQ(spec->camera(), "left");
  const auto& options = OptionsOf<MetavisionSourceOptions>(*spec);
  EXPECT_EQ(options.settings_path, (directory.path() / "left_biases.toml").string());
  EXPECT_EQ(options.clock_id, "cable");
  EXPECT_TRUE(options.uses_triggers);
}

TEST(MetavisionSourceKind, WithoutTheSdkSaysHowToBuildIt) {
  ASSERT_OK_AND_ASSIGN(const auto spec, ParseSourceSpec("left=metavision:serial=1"));
  const absl::Status status = spec->Create().status();
  if (absl::IsNotFound(status)) GTEST_SKIP() << "built with RIGCAL_METAVISION";
  EXPECT_THAT(status,
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("camera left: "), HasSubstr("without live event cameras"),
                             HasSubstr("-DRIGCAL_METAVISION=ON"))));
}

}  // namespace
}  // namespace rigcal::agent::metavision_source_kind_test

// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/world/simulation_options.h"

#include <limits>
#include <string>

#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::simulation_options_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::ParseSimulationOptions;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(SimulationOptions, NothingMeansTheDefaults) {
  for (const char* text : {"", " ", ";", ";;"}) {
    ASSERT_OK_AND_ASSIGN(const SimulationOptions options, ParseSimulationOptions(text));
    EXPECT_EQ(options, SimulationOptions{});
  }
}

TEST(SimulationOptions, ReadsEveryPart) {
  ASSERT_OK_AND_ASSIGN(
      const SimulationOptions options,
      ParseSimulationOptions(
          "seed=7;cameras=12;duration=30;rate=20;noise=0.5;outliers=0.1; "
          "dropouts=0.2;swaps=0.05;wand_speed=2;jitter=0.0001;length_error=0.003;"
          "length_sigma=0.002;focal_sigma=0.005;centre_sigma=6.4;"
          "radial_sigma=0.03;radial_high_sigma=0.1;tangential_sigma=0.001;gap_start=12;gap=10;"
          "free_running=1;clock_samples=1;offset.2=0.008;rate_ppm.2=-50;"
          "rate.3=60;outliers.4=0.3;second_wand.1=0.25"));
  SimulationOptions expected;
  expected.seed = 7;
  expected.camera_count = 12;
  expected.duration_s = 30;
  expected.rate_hz = 20;
  expected.noise_px = 0.5;
  expected.outlier_share = 0.1;
  expected.dropout_share = 0.2;
  expected.swap_share = 0.05;
  expected.max_speed_m_s = 2;
  expected.jitter_s = 0.0001;
  expected.length_error_m = 0.003;
  expected.length_sigma_m = 0.002;
  expected.focal_sigma_rel = 0.005;
  expected.centre_sigma_px = 6.4;
  expected.radial_sigma = 0.03;
  expected.radial_high_sigma = 0.1;
  expected.tangential_sigma = 0.001;
  expected.gap_start_s = 12;
  expected.gap_duration_s = 10;
  expected.free_running = true;
  expected.clock_samples = true;
  expected.time_offset_s = {{2, 0.008}};
  expected.time_rate_ppm = {{2, -50}};
  expected.camera_rate_hz = {{3, 60}};
  expected.camera_outlier_share = {{4, 0.3}};
  expected.camera_second_wand_share = {{1, 0.25}};
  EXPECT_EQ(options, expected);
  EXPECT_THAT(ParseSimulationOptions(FormatSimulationOptions(options)), IsOk());
  EXPECT_EQ(*ParseSimulationOptions(FormatSimulationOptions(options)), expected);
}

TEST(SimulationOptions, KeepsEveryDigit) {
  SimulationOptions options;
  options.seed = std::numeric_limits<uint32_t>::max();
  options.noise_px = 0.1 + 0.2;
  options.duration_s = 100.0 / 3;
  options.time_offset_s = {{0, -1.0 / 3}, {5, 1e-9}};
  ASSERT_OK_AND_ASSIGN(const SimulationOptions again,
                       ParseSimulationOptions(FormatSimulationOptions(options)));
  EXPECT_EQ(again, options);
  EXPECT_EQ(FormatSimulationOptions(SimulationOptions{}), "seed=1;cameras=6");
}

TEST(SimulationOptions, NamesThePartThatIsWrong) {
  const struct {
    const char* text;
    const char* said;
  } cases[] = {
      {"colour=red", "unknown option \"colour\""},
      {"nois=1", "did you mean \"noise\"?"},
      {"seed", "\"seed\" is not KEY=VALUE"},
      {"seed=", "\"seed=\""},
      {"seed=-1", "whole number"},
      {"seed=1.5", "whole number"},
      {"seed=4294967296", "whole number"},
      {"cameras=1", "cameras=1 must be a whole number of 2 to 100"},
      {"cameras=101", "cameras=101"},
      {"cameras=4000000000", "cameras"},
      {"duration=0", "duration"},
      {"duration=-1", "duration"},
      {"duration=nan", "must be a number"},
      {"duration=1e999", "must be a number"},
      {"rate=0", "rate"},
      {"rate=1e9", "rate"},
      {"noise=-0.1", "noise"},
      {"noise=0.3px", "noise=0.3px"},
      {"outliers=1.1", "outliers"},
      {"dropouts=-0.1", "dropouts"},
      {"swaps=2", "swaps"},
      {"wand_speed=0", "wand_speed"},
      {"jitter=0.1", "jitter"},
      {"rate.0=1000;jitter=0.001", "jitter"},
      {"length_error=5", "length_error"},
      {"length_sigma=-0.001", "length_sigma"},
      {"focal_sigma=1", "focal_sigma"},
      {"centre_sigma=-1", "centre_sigma"},
      {"radial_sigma=1", "radial_sigma"},
      {"radial_high_sigma=1", "radial_high_sigma"},
      {"tangential_sigma=1", "tangential_sigma"},
      {"gap_start=-1", "gap_start"},
      {"gap=-1", "gap"},
      {"outliers.0=2", "outliers.0"},
      {"free_running=2", "0 or 1"},
      {"clock_samples=1.0", "0 or 1"},
      {"offset=0.1", "did you mean \"offset.N\"?"},
      {"offset.x=0.1", "by its index"},
      {"offset.-1=0.1", "by its index"},
      {"offset.6=0.1", "camera 6 of 6"},
      {"rate_ppm.0=1e6", "rate_ppm.0"},
      {"rate.0=0", "rate.0"},
      {"seed=1;seed=2", "twice"},
      {"offset.1=1;offset.1=2", "twice"},
  };
  for (const auto& c : cases) {
    EXPECT_THAT(ParseSimulationOptions(c.text),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(c.said)))
        << c.text;
  }
}

TEST(SimulationOptions, ListsEveryFault) {
  SimulationOptions options;
  options.camera_count = 0;
  options.noise_px = std::numeric_limits<double>::quiet_NaN();
  options.max_speed_m_s = std::numeric_limits<double>::infinity();
  EXPECT_THAT(options.Validate(),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("cameras"), HasSubstr("noise"), HasSubstr("wand_speed"))));
}

}  // namespace
}  // namespace rigcal::simulation_options_test

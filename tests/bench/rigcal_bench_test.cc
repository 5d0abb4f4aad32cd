// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "tests/testing/process.h"

namespace rigcal::testing::rigcal_bench_test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr const char* kSuites[] = {"beside_solve", "calibrate", "detect", "event", "ingest",
                                   "live",         "recorded",  "solve",  "spool", "store"};

TEST(RigcalBench, HelpAndListNameEverySuite) {
  const CommandResult help = RunCommand({"rigcal-bench", "--help"});
  const CommandResult list = RunCommand({"rigcal-bench", "--benchmark_list_tests"});
  EXPECT_EQ(help.exit_code, 0);
  EXPECT_EQ(list.exit_code, 0);
  for (const std::string suite : kSuites) {
    EXPECT_THAT(help.output, HasSubstr("\n  " + suite + " "));
    EXPECT_THAT("\n" + list.output, HasSubstr("\n" + suite + "/"));
  }
}

TEST(RigcalBench, RunsOneSuiteWithAFilter) {
  const CommandResult run = RunCommand({"rigcal-bench", "store", "--benchmark_filter=Encode",
                                        "--benchmark_min_time=0.001", "--benchmark_format=csv"});
  EXPECT_EQ(run.exit_code, 0) << run.error;
  EXPECT_THAT(run.output, HasSubstr("\"store/Encode\""));
  EXPECT_THAT(run.output, Not(HasSubstr("store/Append")));
}

// As short as can be: whether it runs to its end, and what is no matter of speed.
TEST(RigcalBench, TheLiveSuiteRunsWithAServer) {
  const CommandResult run = RunCommand(
      {"rigcal-bench", "live", "--benchmark_format=json"},
      {{"RIGCAL_LIVE_CAMERAS", "3"}, {"RIGCAL_LIVE_ROUNDS", "1"}, {"RIGCAL_LIVE_SECONDS", "1"}});
  ASSERT_EQ(run.exit_code, 0) << run.error;
  const auto result = nlohmann::json::parse(run.output).at("benchmarks").at(0);
  ASSERT_FALSE(result.contains("error_message")) << result;
  EXPECT_GT(result.at("polls"), 0);
  EXPECT_GT(result.at("previews"), 0);
  EXPECT_EQ(result.at("failed_polls"), 0);
  EXPECT_EQ(result.at("unchanged_304_share"), 1);
}

TEST(RigcalBench, TheDetectorFindsTheWandsOfADarkRoom) {
  const CommandResult run =
      RunCommand({"rigcal-bench", "detect", "--benchmark_filter=room/dark/Detector",
                  "--benchmark_format=json"});
  ASSERT_EQ(run.exit_code, 0) << run.error;
  const auto result = nlohmann::json::parse(run.output).at("benchmarks").at(0);
  EXPECT_GE(result.at("found_%"), 95);
  EXPECT_EQ(result.at("false"), 0);
  EXPECT_GE(result.at("worst_ms"), result.at("median_ms"));
}

TEST(RigcalBench, RefusesAnUnknownSuite) {
  const CommandResult run = RunCommand({"rigcal-bench", "stores"});
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_THAT(run.error, HasSubstr("'stores'"));
}

}  // namespace
}  // namespace rigcal::testing::rigcal_bench_test

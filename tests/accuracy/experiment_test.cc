// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/experiment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>

#include "tests/accuracy/seed_options.h"

namespace rigcal::accuracy::experiment_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::internal::CaptureStderr;
using ::testing::internal::CaptureStdout;
using ::testing::internal::GetCapturedStderr;
using ::testing::internal::GetCapturedStdout;

struct CommandOutput {
  int exit_code = 0;
  std::string output, error;
};

CommandOutput Parse(const std::vector<Experiment>& experiments,
                    std::vector<const char*> arguments) {
  arguments.insert(arguments.begin(), "rigcal-accuracy");
  CaptureStdout();
  CaptureStderr();
  CommandOutput run;
  run.exit_code = RunExperiment(experiments, static_cast<int>(arguments.size()), arguments.data());
  run.output = GetCapturedStdout();
  run.error = GetCapturedStderr();
  return run;
}

// Copies the options of the last run to `seen`.
Experiment Recorder(const std::string& name, SeedOptions* seen) {
  SeedOptions defaults;
  defaults.count = 7;
  return SeedExperiment(name, "summary of " + name, defaults, [seen](const SeedOptions& seeds) {
    *seen = seeds;
    return 3;
  });
}

TEST(RunExperiment, HelpListsEveryExperimentWithItsSummary) {
  const std::vector<Experiment> experiments = AllExperiments();
  EXPECT_FALSE(experiments.empty());
  const CommandOutput run = Parse(experiments, {"--help"});
  EXPECT_EQ(run.exit_code, 0);
  for (const Experiment& experiment : experiments) {
    EXPECT_THAT(run.output, AllOf(HasSubstr(experiment.name), HasSubstr(experiment.summary)));
  }
}

TEST(RunExperiment, HelpOfAnExperimentShowsItsDefaults) {
  SeedOptions seen;
  const CommandOutput run = Parse({Recorder("first", &seen)}, {"first", "--help"});
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_THAT(run.output, AllOf(HasSubstr("--seeds INT:INT in [1 - 100000]=7"),
                                HasSubstr("--first-seed"), HasSubstr("--verbose")));
}

TEST(RunExperiment, RunsTheNamedExperimentWithItsOptions) {
  SeedOptions first, second;
  const std::vector<Experiment> experiments = {Recorder("first", &first),
                                               Recorder("second", &second)};
  const CommandOutput run =
      Parse(experiments, {"second", "--first-seed", "5", "--duration", "12.5", "--verbose"});
  EXPECT_EQ(run.exit_code, 3);
  EXPECT_EQ(second.count, 7);
  EXPECT_EQ(second.first, 5);
  EXPECT_EQ(second.duration_s, 12.5);
  EXPECT_TRUE(second.verbose);
  EXPECT_EQ(first.count, SeedOptions{}.count);
}

TEST(RunExperiment, RefusesWrongUsage) {
  SeedOptions seen;
  const std::vector<Experiment> experiments = {Recorder("first", &seen)};
  const CommandOutput unknown = Parse(experiments, {"frist"});
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_THAT(unknown.error, AllOf(HasSubstr("'frist'"), HasSubstr("there are: first")));
  EXPECT_EQ(Parse(experiments, {}).exit_code, 2);
  EXPECT_EQ(Parse(experiments, {"first", "--seeds", "0"}).exit_code, 2);
  EXPECT_EQ(Parse(experiments, {"first", "--sedes", "1"}).exit_code, 2);
}

}  // namespace
}  // namespace rigcal::accuracy::experiment_test

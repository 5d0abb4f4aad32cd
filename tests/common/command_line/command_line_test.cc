// SPDX-License-Identifier: Apache-2.0
#include "common/command_line/command_line.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

namespace rigcal::command_line_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

struct Outcome {
  absl::StatusOr<CommandLineTask> task;
  std::string out;
  std::string error() const { return std::string(task.status().message()); }
};

// A program with the commands "session list", "get" and "create", "local" and "export".
Outcome Parse(const std::vector<std::string>& arguments) {
  CLI::App app("A program of a test", "prog");
  std::string level, target, id, output;
  app.add_option("--log-level", level);
  app.require_subcommand(1);
  CLI::App* const session = app.add_subcommand("session");
  session->require_subcommand(1);
  session->add_subcommand("list");
  session->add_subcommand("get");
  CLI::App* const local = app.add_subcommand("local");
  std::string data, accept;
  local->add_option("--data", data)->required();
  local->add_option("--accept-mm", accept);
  CLI::App* const create = session->add_subcommand("create");
  create->add_option("--target", target)->required();
  CLI::App* const files = app.add_subcommand("export");
  files->add_option("ID", id)->required();
  files->add_option("-o,--output", output);
  AddFormerOption(files, "--out", "--output DIR");
  AddVersionFlags(app, "1.2.3");
  std::ostringstream out;
  Outcome outcome{.task = ParseCommandLine(app, arguments, out), .out = {}};
  outcome.out = out.str();
  return outcome;
}

TEST(CommandLine, WhatIsRightIsToBeRun) {
  const Outcome outcome = Parse({"session", "create", "--target", "x"});
  ASSERT_TRUE(outcome.task.ok()) << outcome.error();
  EXPECT_EQ(*outcome.task, CommandLineTask::kRun);
}

TEST(CommandLine, EveryCommandTellsTheVersionWhateverElseIsMissing) {
  for (const std::vector<std::string>& arguments :
       std::vector<std::vector<std::string>>{{"--version"},
                                             {"session", "--version"},
                                             {"session", "create", "--version"},
                                             {"export", "--version"}}) {
    const Outcome outcome = Parse(arguments);
    ASSERT_TRUE(outcome.task.ok()) << outcome.error();
    EXPECT_EQ(*outcome.task, CommandLineTask::kDone);
    EXPECT_EQ(outcome.out, "prog 1.2.3\n");
  }
}

TEST(CommandLine, WhatWasProbablyMeantIsNamed) {
  struct Case {
    std::vector<std::string> arguments;
    std::string meant;
  };
  const std::vector<Case> cases = {
      {{"sesion", "list"}, "did you mean 'prog session'?"},
      {{"session", "lst"}, "did you mean 'prog session list'?"},
      {{"session", "create", "--taget", "x"}, "did you mean --target?"},
      {{"session", "create", "--taget=x"}, "did you mean --target?"},
      {{"session", "list", "--log-levle", "x"}, "did you mean --log-level?"},
      {{"create"}, "did you mean 'prog session create'?"},
      {{"session", "export"}, "did you mean 'prog export'?"},
      {{"session", "create", "-target", "x"}, "it is --target"},
      {{"export", "a", "-output", "x"}, "it is --output"},
      {{"session", "list", "--log-level", "x"},
       "--log-level is an option of prog: write it in front"},
      {{"session"}, "list, get, create"},
      {{"frobnicate"}, "session, local, export"},
      {{"session", "show", "wave"}, "did you mean 'prog session get'?"},
      {{"session", "ls"}, "did you mean 'prog session list'?"},
      {{"local", "--data", "x", "--accept", "2"}, "did you mean --accept-mm?"},
      {{"local", "folder"}, "did you mean --data folder?"},
      {{"export", "a", "b"}, "'b' is one argument too many"},
      {{"export", "a", "--out", "x"}, "it is --output DIR now"},
      {{"export", "a", "--out"}, "it is --output DIR now"},
  };
  for (const Case& each : cases) {
    const Outcome outcome = Parse(each.arguments);
    EXPECT_TRUE(absl::IsInvalidArgument(outcome.task.status()));
    EXPECT_THAT(outcome.error(), AllOf(HasSubstr(each.meant), HasSubstr("--help")))
        << ::testing::PrintToString(each.arguments);
    EXPECT_THAT(outcome.error(), Not(HasSubstr("\n")));
  }
}

TEST(CommandLine, NothingIsGuessedWhereNothingIsNear) {
  EXPECT_THAT(Parse({"session", "list", "--checkerboard"}).error(),
              AllOf(HasSubstr("prog session list has no option '--checkerboard'"),
                    Not(HasSubstr("did you mean"))));
  EXPECT_THAT(Parse({"export"}).error(), HasSubstr("ID is required"));
}

TEST(CommandLine, AFormerOptionIsNotInTheHelp) {
  EXPECT_THAT(Parse({"export", "--help"}).out,
              AllOf(HasSubstr("--output"), Not(HasSubstr("--out "))));
}

TEST(CommandLine, BytesThatAreNoTextAreShownEscaped) {
  EXPECT_THAT(Parse({"export", "a\xff"}).error(), HasSubstr("'a\\xff' is not UTF-8"));
}

}  // namespace
}  // namespace rigcal::command_line_test

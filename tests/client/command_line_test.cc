// SPDX-License-Identifier: Apache-2.0
// What a command line that is wrong, or asks for help, gets.
#include "client/command_line.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "tests/client/command_runner.h"
#include "tests/client/fake_server.h"

namespace rigcal::client::command_line_test {
namespace {

using ::rigcal::testing::CommandOutcome;
using ::rigcal::testing::FakeServer;
using ::rigcal::testing::Rigcal;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

struct UsageCase {
  std::vector<std::string> arguments;
  std::string complaint;
};

TEST(CommandLine, UsageErrorsExitWithTwoAndSayWhatIsWrong) {
  const std::vector<UsageCase> cases = {
      {{}, "subcommand"},
      {{"no-such-command"}, "no-such-command"},
      {{"session"}, "subcommand"},
      {{"session", "frobnicate"}, "frobnicate"},
      {{"session", "create"}, "--target"},
      {{"session", "create", "--target", "wand:0,0"}, "wand:0,0"},
      {{"session", "create", "--target", "stick:1"}, "stick:1"},
      {{"session", "get"}, "SESSION"},
      {{"session", "get", "a", "b"}, "b"},
      {{"session", "stop", "a", "--drain-timeout", "601"}, "601"},
      {{"session", "stop", "a", "--drain-timeout", "nan"}, "nan"},
      {{"session", "list", "-o", "xml"}, "xml"},
      {{"session", "get", "bad\xff"}, "not UTF-8"},
      {{"session", "get", "cut\xc3"}, "not UTF-8"},
      {{"session", "list", "--server", "nowhere"}, "nowhere"},
      {{"session", "list", "--server", ""}, "HOST:PORT"},
      {{"session", "list", "--frobnicate"}, "--frobnicate"},
      {{"calibrate"}, "SESSION"},
      {{"calibrate", "a", "--intrinsics", "maybe"}, "maybe"},
      {{"calibrate", "a", "--seed", "-1"}, "-1"},
      {{"calibrate", "a", "--distance", "left,left,2"}, "left twice"},
      {{"calibrate", "a", "--distance", "left,right,nan"}, "distance_m"},
      {{"calibrate", "a", "--distance", "left,right,2,inf"}, "sigma_m"},
      {{"calibrate", "a", "--distance", "left,right,2,x"}, "'x'"},
      {{"calibrate", "a", "--distance", "left,right"}, "two cameras"},
      {{"calibrate", "a", "--seed", "1.5"}, "seed"},
      {{"calibrate", "a", "--association-tolerance-ms", "inf"}, "inf"},
      {{"calibration", "export", "a", "--format", "opencv"}, "--output"},
      {{"calibration", "export", "a", "--format", "opencv", "--output", "-"}, "json"},
      {{"calibration", "export", "a", "--format", "xml", "--output", "d"}, "xml"},
      {{"calibration", "compare", "a"}, "B"},
      {{"calibration", "import", "a.xcp"}, "--output"},
      {{"calibration", "import", "a.xcp", "--output", "d", "--format", "xml"}, "xml"},
      {{"evaluate", "a.csv"}, "--ground-truth"},
      {{"local"}, "--data"},
      {{"local", "--data", "somewhere"}, "--target"},
      {{"local", "--data", "", "--target", "wand:0,1"}, "--data"},
      {{"local", "--data", "a", "--simulate", "", "--target", "wand:0,1"}, "either"},
      {{"local", "--simulate", "camera=6"}, "camera=6"},
      {{"local", "--simulate", "cameras=1"}, "cameras"},
      {{"local", "--simulate", "", "--speed", "0"}, "max"},
      {{"local", "--simulate", "", "--speed", "nan"}, "max"},
      {{"local", "--simulate", "", "--keep", ""}, "--keep"},
  };
  for (const UsageCase& usage : cases) {
    const CommandOutcome outcome = Rigcal(usage.arguments);
    const std::string line = ::testing::PrintToString(usage.arguments);
    EXPECT_EQ(outcome.exit_code, 2) << line;
    EXPECT_THAT(outcome.err, AllOf(HasSubstr(usage.complaint), HasSubstr("--help"))) << line;
    EXPECT_THAT(outcome.out, IsEmpty()) << line;
  }
}

TEST(CommandLine, HelpGoesToStdoutAndEndsWithTheExitCodes) {
  for (const std::vector<std::string>& arguments :
       std::vector<std::vector<std::string>>{{"--help"},
                                             {"-h"},
                                             {"session", "--help"},
                                             {"session", "create", "--help"},
                                             {"calibrate", "--help"},
                                             {"local", "--help"}}) {
    const CommandOutcome outcome = Rigcal(arguments);
    EXPECT_EQ(outcome.exit_code, 0);
    EXPECT_THAT(outcome.err, IsEmpty());
    for (const char* line : {"  0  ok\n", "  1  failed\n", "  2  usage", "  3  calibrated, but",
                             "  4  not allowed\n", "  6  server unreachable\n"}) {
      EXPECT_THAT(outcome.out, HasSubstr(line));
    }
  }
}

TEST(CommandLine, HelpNamesEveryCommandAndFitsATerminal) {
  const CommandOutcome outcome = Rigcal({"--help"});
  for (const char* command : {"local", "session", "agent", "calibrate", "calibration", "doctor"}) {
    EXPECT_THAT(outcome.out, HasSubstr(std::string("\n  ") + command + " "));
  }
  for (const char* command : {"local", "calibrate", "doctor"}) {
    std::istringstream lines(Rigcal({command, "--help"}).out);
    for (std::string line; std::getline(lines, line);) {
      // One word (an example) may be longer.
      if (line.find_last_of(' ') > 30) {
        EXPECT_LE(line.size(), 80u) << line;
      }
    }
  }
}

TEST(CommandLine, TellsItsVersion) {
  const CommandOutcome outcome = Rigcal({"--version"});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(outcome.out, HasSubstr("rigcal 0."));
}

TEST(CommandLine, UnreachableServerExitsWithSix) {
  for (const std::vector<std::string>& arguments :
       std::vector<std::vector<std::string>>{{"session", "list"},
                                             {"session", "watch", "a"},
                                             {"session", "observations", "a"},
                                             {"session", "stop", "a", "--wait"},
                                             {"calibrate", "a", "--wait"},
                                             {"calibration", "compare", "a", "b"},
                                             {"agent", "list"},
                                             {"doctor"}}) {
    std::vector<std::string> line = arguments;
    line.insert(line.end(), {"--server", "127.0.0.1:1"});
    const CommandOutcome outcome = Rigcal(line);
    EXPECT_EQ(outcome.exit_code, 6) << ::testing::PrintToString(arguments);
    EXPECT_THAT(outcome.err + outcome.out,
                AllOf(HasSubstr("127.0.0.1:1"), HasSubstr("RIGCAL_SERVER")));
  }
}

TEST(CommandLine, TheServersRefusalsHaveTheirCodes) {
  FakeServer fake;
  const std::vector<std::pair<grpc::StatusCode, int>> cases = {
      {grpc::StatusCode::PERMISSION_DENIED, 4},   {grpc::StatusCode::UNAUTHENTICATED, 4},
      {grpc::StatusCode::UNAVAILABLE, 6},         {grpc::StatusCode::NOT_FOUND, 1},
      {grpc::StatusCode::FAILED_PRECONDITION, 1}, {grpc::StatusCode::INTERNAL, 1},
      {grpc::StatusCode::RESOURCE_EXHAUSTED, 1},  {grpc::StatusCode::INVALID_ARGUMENT, 1}};
  for (const auto& [code, exit_code] : cases) {
    fake.failures["GetSession"] = grpc::Status(code, "because of this");
    const CommandOutcome outcome = Rigcal({"session", "get", "a", "--server", fake.address()});
    EXPECT_EQ(outcome.exit_code, exit_code) << code;
    EXPECT_THAT(outcome.err, HasSubstr("because of this"));
    EXPECT_THAT(outcome.out, IsEmpty());
  }
}

TEST(CommandLine, ServerAndFormatMayStandInFrontOrBehind) {
  FakeServer fake;
  EXPECT_EQ(Rigcal({"--server", fake.address(), "-o", "json", "session", "list"}).exit_code, 0);
  EXPECT_EQ(Rigcal({"session", "list", "-o", "json", "--server", fake.address()}).exit_code, 0);
}

TEST(CommandLine, ServerComesFromTheEnvironmentUnlessNamed) {
  FakeServer fake;
  setenv("RIGCAL_SERVER", fake.address().c_str(), 1);
  EXPECT_EQ(Rigcal({"session", "list"}).exit_code, 0);
  EXPECT_EQ(Rigcal({"session", "list", "--server", "127.0.0.1:1"}).exit_code, 6);
  setenv("RIGCAL_SERVER", "nonsense", 1);
  EXPECT_EQ(Rigcal({"session", "list"}).exit_code, 2);
  // A command that asks no server does not mind: this one fails for its folder.
  EXPECT_EQ(Rigcal({"local", "--data", "/nowhere", "--target", "wand:0,1"}).exit_code, 1);
  unsetenv("RIGCAL_SERVER");
}

TEST(CommandLine, IdsThatAreWordsOfOursAreIds) {
  FakeServer fake;
  for (const char* id : {"doctor", "list", "local", "get"}) {
    const CommandOutcome outcome = Rigcal({"session", "get", id, "--server", fake.address()});
    EXPECT_EQ(outcome.exit_code, 1) << id;
    EXPECT_THAT(outcome.err, HasSubstr(std::string("no session ") + id));
  }
}

}  // namespace
}  // namespace rigcal::client::command_line_test

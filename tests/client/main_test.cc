// SPDX-License-Identifier: Apache-2.0
// The program around the commands: descriptors, pipes, exit codes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/client/fake_server.h"
#include "tests/client/sample_messages.h"
#include "tests/testing/process.h"

namespace rigcal::client::main_test {
namespace {

using ::rigcal::testing::CommandResult;
using ::rigcal::testing::FakeServer;
using ::rigcal::testing::FullSession;
using ::rigcal::testing::RunCommand;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class Program : public ::testing::Test {
 protected:
  // A shell line in which $RIGCAL is the program.
  CommandResult Shell(const std::string& line) const {
    return RunCommand({"/bin/sh", "-c", line}, {{"RIGCAL", std::string(RIGCAL_BIN_DIR) + "/rigcal"},
                                                {"RIGCAL_SERVER", fake_.address()}});
  }

  FakeServer fake_;
};

TEST_F(Program, PassesTheExitCodeOn) {
  EXPECT_EQ(Shell("$RIGCAL session list").exit_code, 0);
  EXPECT_EQ(Shell("$RIGCAL session get nobody").exit_code, 1);
  EXPECT_EQ(Shell("$RIGCAL frobnicate").exit_code, 2);
  EXPECT_EQ(Shell("$RIGCAL session list --server 127.0.0.1:1").exit_code, 6);
}

TEST_F(Program, AReaderThatHasSeenEnoughIsNoError) {
  for (int i = 0; i < 3000; ++i) {
    const std::string id = "session-with-a-long-name-" + std::to_string(i);
    fake_.sessions[id] = FullSession(id);
  }
  const CommandResult result =
      Shell("{ $RIGCAL session list -o json; echo code $? >&2; } | head -n 1");
  EXPECT_EQ(result.output, "{\n");
  EXPECT_EQ(result.error, "code 0\n");
}

TEST_F(Program, AFullDiskIsAnError) {
  const CommandResult result = Shell("$RIGCAL session list > /dev/full");
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.error, HasSubstr("No space left"));
}

TEST_F(Program, AClosedStdoutIsAnErrorAndNotAConnection) {
  const CommandResult result = Shell("$RIGCAL session list <&- >&-");
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.error, HasSubstr("cannot write to stdout"));
}

TEST_F(Program, AClosedStderrIsNoCrash) {
  EXPECT_EQ(Shell("$RIGCAL session get nobody 2>&-").exit_code, 1);
}

TEST_F(Program, MessagesAndResultsDoNotMix) {
  const CommandResult result = Shell("$RIGCAL session get nobody -o json");
  EXPECT_THAT(result.output, IsEmpty());
  EXPECT_THAT(result.error, HasSubstr("nobody"));
}

}  // namespace
}  // namespace rigcal::client::main_test

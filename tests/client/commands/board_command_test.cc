// SPDX-License-Identifier: Apache-2.0
#include "client/commands/board_command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "tests/client/command_runner.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::client::board_command_test {
namespace {

using ::rigcal::testing::CommandOutcome;
using ::rigcal::testing::Rigcal;
using ::testing::HasSubstr;

TEST(BoardCommand, ShowsABoardWithoutAServer) {
  const CommandOutcome shown = Rigcal({"board", "show", "board:checker,9x6,0.03"});
  EXPECT_EQ(shown.exit_code, 0) << shown.err;
  EXPECT_THAT(shown.out, HasSubstr("10 x 7 squares of 30 mm"));
  const CommandOutcome json = Rigcal({"board", "show", "board:checker,9x6,0.03", "-o", "json"});
  EXPECT_EQ(nlohmann::json::parse(json.out)["columns"], 9);
}

TEST(BoardCommand, PrintsOnceUnlessForced) {
  const rigcal::testing::TemporaryDirectory folder;
  const std::string file = (std::filesystem::path(folder.path()) / "board.svg").string();
  const std::vector<std::string> command = {"board", "print", "board:circles,4x11,0.02", "--output",
                                            file};
  EXPECT_EQ(Rigcal(command).exit_code, 0);
  std::ifstream stream(file);
  const std::string svg{std::istreambuf_iterator<char>(stream), {}};
  EXPECT_THAT(svg, HasSubstr("<circle"));
  const CommandOutcome again = Rigcal(command);
  EXPECT_EQ(again.exit_code, 1);
  EXPECT_THAT(again.err, HasSubstr("--force"));
  std::vector<std::string> forced = command;
  forced.push_back("--force");
  EXPECT_EQ(Rigcal(forced).exit_code, 0);
}

TEST(BoardCommand, PrintsTheBackBesideTheFront) {
  const rigcal::testing::TemporaryDirectory folder;
  const std::filesystem::path front = std::filesystem::path(folder.path()) / "board.svg";
  const std::filesystem::path back = std::filesystem::path(folder.path()) / "board.back.svg";
  const std::vector<std::string> command = {
      "board", "print", "board:charuco,10x7,0.025,0.018,5x5_100,two-sided=0.004", "--output",
      front.string()};
  const CommandOutcome printed = Rigcal(command);
  EXPECT_EQ(printed.exit_code, 0) << printed.err;
  EXPECT_THAT(printed.out, HasSubstr(back.string()));
  const auto text = [](const std::filesystem::path& file) {
    std::ifstream stream(file);
    return std::string{std::istreambuf_iterator<char>(stream), {}};
  };
  EXPECT_THAT(text(front), HasSubstr("(front)"));
  EXPECT_THAT(text(back), HasSubstr("(back)"));
  // A back that is there is not overwritten, nor is the front without it.
  std::filesystem::remove(front);
  EXPECT_EQ(Rigcal(command).exit_code, 1);
  EXPECT_FALSE(std::filesystem::exists(front));
}

TEST(BoardCommand, AWrongBoardIsAUsageError) {
  const CommandOutcome wrong = Rigcal({"board", "show", "board:checker,9x6,30"});
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("30 mm are 0.03"));
}

}  // namespace
}  // namespace rigcal::client::board_command_test

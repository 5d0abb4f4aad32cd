// SPDX-License-Identifier: Apache-2.0
#include "client/commands/board_command.h"

#include <filesystem>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "client/commands/command_parser.h"
#include "common/board/board_drawing.h"
#include "common/file/durable_file.h"
#include "common/file/may_write.h"

namespace rigcal::client {
namespace {

nlohmann::ordered_json BoardJson(const Board& board) {
  const BoardSheet sheet = SheetOf(board);
  return {{"board", FormatBoard(board)},
          {"columns", board.columns},
          {"rows", board.rows},
          {"spacing_m", board.spacing_m},
          {"pattern_mm", {sheet.pattern_width_mm, sheet.pattern_height_mm}},
          {"sheet_mm", {sheet.width_mm, sheet.height_mm}},
          {"circle_diameter_mm", sheet.circle_diameter_mm},
          {"has_twin", board.HasTwin()},
          {"thickness_m", board.thickness_m}};
}

// "board.svg" -> "board.back.svg"
std::string BackFile(const std::string& front) {
  std::filesystem::path path = front;
  path.replace_extension(".back" + path.extension().string());
  return path.string();
}

void AddBoardArgument(CLI::App* app, Board* board) {
  AddParsedOption(
      app, "BOARD", "", board, [](const std::string& text) { return ParseBoard(text); },
      "board:checker,9x6,0.03: 9 x 6 inner corners, squares of 0.03 m; "
      "board:circles,4x11,0.02; board:circles-symmetric,9x6,0.02; "
      "board:charuco,8x6,0.03,0.022,5x5_100: 8 x 6 squares, their side, side of a marker, "
      "dictionary; board:aprilgrid,6x6,0.088,0.3: tags, their side, gap over side (kalibr); the "
      "last two with ,two-sided=0.004 for both sides, 0.004 m apart")
      ->required();
}

}  // namespace

ExitCode ShowBoard(const BoardCommandOptions& options, CommandContext& context) {
  if (context.console.format == OutputFormat::kJson) {
    context.console.out << JsonText(BoardJson(options.board)) << "\n" << std::flush;
  } else {
    context.console.Print(DescribeBoard(options.board));
  }
  return ExitCode::kOk;
}

ExitCode PrintBoard(const BoardCommandOptions& options, CommandContext& context) {
  const std::string back = options.board.IsTwoSided() ? BackFile(options.output) : "";
  absl::Status status;
  if (std::filesystem::path(options.output).extension() != ".svg") {
    status = absl::InvalidArgumentError(
        absl::StrCat("--output ", options.output,
                     ": a board is written as SVG, so name it .svg; a browser prints it"));
  }
  if (status.ok()) status = CheckOutputFile(options.output, options.force);
  if (status.ok() && !back.empty()) status = CheckOutputFile(back, options.force);
  if (status.ok()) status = WriteOutputFile(options.output, BoardSvg(options.board));
  if (status.ok() && !back.empty()) {
    status = WriteOutputFile(back, BoardSvg(options.board, BoardSide::kBack));
  }
  if (!status.ok()) return context.Fail(status);
  if (context.console.format == OutputFormat::kJson) {
    nlohmann::ordered_json json = BoardJson(options.board);
    json["file"] = options.output;
    if (!back.empty()) json["back_file"] = back;
    context.console.out << JsonText(json) << "\n" << std::flush;
  } else {
    context.console.Print(absl::StrCat(DescribeBoard(options.board), "written: ", options.output,
                                       back.empty() ? "" : ", " + back, "\n"));
  }
  return ExitCode::kOk;
}

void AddBoardCommands(CommandParser& parser) {
  CLI::App* const group =
      parser.AddGroup("board", "Boards for calibrating lenses: what they are, and printing them");
  {
    auto [app, options] =
        parser.AddCommand(group, "show", "Say how large a board is and how to print it", ShowBoard,
                          /*asks_server=*/false);
    AddBoardArgument(app, &options->board);
  }
  auto [app, options] = parser.AddCommand(group, "print", "Write a board as an SVG file to scale",
                                          PrintBoard, /*asks_server=*/false);
  AddBoardArgument(app, &options->board);
  AddOption(
      app, "--output", "FILE", &options->output,
      "The SVG file to write; the back of a board with two sides goes beside it, as NAME.back.svg")
      ->required();
  AddForceOption(app, &options->force);
}

}  // namespace rigcal::client

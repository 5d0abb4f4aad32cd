// SPDX-License-Identifier: Apache-2.0
// The tables of the eWand paper (Gossard, Ziegler et al., ICRA 2024) on its rig, rendered from
// light to pixels and events or simulated as points, and on the recording that was published with
// it. That is found in ../shared/data beside the project, in RIGCAL_TEST_DATA, or where --data
// says.
#include "tests/accuracy/paper/paper.h"

#include <fmt/core.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tests/accuracy/paper/paper_plot.h"
#include "tests/accuracy/paper/paper_report.h"
#include "tests/accuracy/paper/paper_run.h"
#include "tests/accuracy/solver/recording.h"
#include "tests/server/solve/recorded_input.h"

namespace rigcal::accuracy {
namespace {

struct PaperArguments {
  PaperOptions options;
  std::string data, csv, page, png;
};

bool WriteFile(const std::string& path, const std::string& text) {
  if (path.empty()) return true;
  std::ofstream file(path);
  file << text;
  file.close();
  if (!file) fmt::print(stderr, "{}: cannot write it; does its folder exist?\n", path);
  return !file.fail();
}

// The figure as seen from the page.
std::string FigureFrom(const PaperArguments& arguments) {
  if (arguments.png.empty()) return "";
  const std::filesystem::path folder = std::filesystem::absolute(arguments.page).parent_path();
  return std::filesystem::absolute(arguments.png).lexically_relative(folder).generic_string();
}

absl::StatusOr<std::vector<PaperRealRow>> RunReal(const std::string& data) {
  if (!data.empty() && !std::filesystem::is_directory(std::filesystem::path(data) / "ewand")) {
    return absl::NotFoundError(
        absl::StrCat("--data ", data, ": it has no folder ewand; name the folder above that"));
  }
  const absl::StatusOr<server::CalibrationInput> input =
      data.empty() ? WandRecording() : server::RecordedInput(data);
  if (!input.ok()) return input.status();
  return RunPaperRecording(*input);
}

int RunPaperTables(const PaperArguments& arguments) {
  const std::vector<PaperRow> rows = RunPaper(arguments.options);
  const std::string& only = arguments.options.only;
  std::vector<PaperRealRow> real;
  bool failed = false;
  if (std::string("recording").find(only) != std::string::npos) {
    const absl::StatusOr<std::vector<PaperRealRow>> run = RunReal(arguments.data);
    if (run.ok()) real = *run;
    // Who does not name a recording need not have one.
    failed =
        !run.ok() && !(absl::IsNotFound(run.status()) && arguments.data.empty() && only.empty());
    if (!run.ok()) fmt::print(stderr, "the published recording: {}\n", run.status().ToString());
  }
  if (rows.empty() && real.empty()) {
    if (!failed) {
      fmt::print(stderr, "no row has \"{}\" in its name; without --only all are printed\n", only);
    }
    return 1;
  }
  fmt::print("{}", PaperText(arguments.options, rows, real));
  for (const PaperRow& row : rows) failed |= row.solved < arguments.options.seeds;
  if (!rows.empty()) fmt::print("\nSHA-256 of the CSV: {}\n", PaperDigest(rows));
  absl::Status drawn;
  if (!arguments.png.empty()) drawn = DrawPaper(rows, arguments.png);
  if (!drawn.ok()) fmt::print(stderr, "{}\n", std::string(drawn.message()));
  const std::string figure = drawn.ok() ? FigureFrom(arguments) : "";
  const bool written = WriteFile(arguments.csv, PaperCsv(rows)) &&
                       WriteFile(arguments.page, PaperPage(arguments.options, rows, real, figure));
  failed |= !drawn.ok();
  return failed || !written ? 1 : 0;
}

Experiment::Run PreparePaper(OptionList* list) {
  const auto arguments = std::make_shared<PaperArguments>();
  PaperOptions& options = arguments->options;
  list->AddFlag("--points", &options.points, "simulated points, nothing is rendered or detected");
  list->Add("--seeds", &options.seeds, 1, 1000, "number of rigs");
  list->Add("--first-seed", &options.first_seed, 0, 1 << 30, "lowest seed");
  list->Add("--threads", &options.threads, 1, 256, "recordings solved at the same time");
  list->Add("--duration", &options.recording.duration_s, 5, 3600, "seconds of waving");
  list->Add("--path", &options.recording.path_s, 2, 3600, "seconds of the marker of Table II");
  list->Add("--board-rate", &options.recording.board_rate_hz, 1, kPaperTriggerHz,
            "views of a board that are used, a second");
  list->Add("--board-angle", &options.recording.board_angle_deg, 5, 180,
            "a camera sees a board whose front points to it by less, degrees; 180: both sides");
  list->Add("--only", &options.only,
            "rows with this in \"CONDITION: METHOD\", or recording: the published one");
  list->Add("--data", &arguments->data, "folder that has the published recording as ewand/");
  list->Add("--csv", &arguments->csv, "file to write the figures to");
  list->Add("--page", &arguments->page, "Markdown file to write the tables to");
  list->Add("--png", &arguments->png, "PNG file to draw the error by seconds of waving to");
  return [arguments] { return RunPaperTables(*arguments); };
}

}  // namespace

Experiment Paper() {
  return {"paper", "the tables of the eWand paper: wand and boards, rendered or as points",
          PreparePaper};
}

}  // namespace rigcal::accuracy

// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/paper/paper_report.h"

#include <fmt/core.h>

#include <cmath>
#include <string_view>

#include "common/status/status_macros.h"
#include "tests/accuracy/paper/index_paired_solve.h"

namespace rigcal::accuracy {
namespace {

PaperRealRow RealRow(const char* method, const CalibrationResult& calibration) {
  PaperRealRow row{method, {}, {}};
  for (const CalibratedCamera& camera : calibration.cameras) {
    PaperSums sums;
    sums.Add(camera.residuals.all.mean_px, camera.residuals.all.rms_px, 1);
    row.mean_px.push_back(sums.Mean());
    row.sd_px.push_back(sums.StandardDeviation());
  }
  return row;
}

// What is simulated, a stand-in or missing; a line for each.
std::vector<std::string> Limits(const PaperOptions& options) {
  const PaperRecordingOptions& recording = options.recording;
  const auto noise = [](PaperTarget target) {
    return fmt::format("{} and {}", NoiseOf(target).frame_px, NoiseOf(target).event_px);
  };
  return {
      "Simulated points, not pixels: nothing is rendered or detected. The rigs are drawn; lenses "
      "are exactly as given.",
      fmt::format("Seeds {} to {}; every target is waved for {} s along the same path. A wand "
                  "is seen 50 times a second, a board used {} times.",
                  options.first_seed, options.first_seed + options.seeds - 1, recording.duration_s,
                  recording.board_rate_hz),
      fmt::format("One sigma of a coordinate, px, in frame and event cameras: wand {}, circles {}, "
                  "checkerboard {}.",
                  noise(PaperTarget::kWand), noise(PaperTarget::kCircles),
                  noise(PaperTarget::kChecker)),
      "Those of boards in frame cameras were measured of boards 0.5 to 0.8 m away that stand "
      "still: too good for boards that are waved 2 to 6 m away. That of a checkerboard in an event "
      "camera is a stand-in: the one of printed circles. A print's common shift is left out.",
      "The event cameras give what they see 50 times a second, at the trigger: the row that is "
      "paired by index needs that.",
      fmt::format("A board is seen whole, and where its front points to the camera by less than {} "
                  "degrees. 2 % of all views are missed. There are no outliers.",
                  recording.board_angle_deg),
      "Targets are exactly as given; \"targets as built\": each span of the wand is off by 0.1 mm, "
      "each coordinate of a board's points by 0.3 mm (one sigma). Boards are held as given.",
      "A board turns once around the vertical in 20 s, so that every camera has its turn, and "
      "swings by 34 degrees.",
      "\"frame_0 8 ms early\": it is exposed 8 ms before the others, all stamps say together. "
      "\"frame_1 bumped later\": moved by 5 mm and turned by 0.3 degrees between the calibration "
      "and the marker of Table II; nobody calibrated again. \"boards noisy as the wand\": points "
      "of boards have the noise of the wand's centres.",
      "\"the true rig\" is not calibrated: what the noise of the marker alone leaves in Table II. "
      "\"exact marker\": its centres have no noise, the error is that of the calibration alone.",
      "\"paired by index\" is our reading of the paper's description, not its program, and starts "
      "at rigcal's poses.",
      "Missing: kalibr's method (continuous trajectory, robust).",
  };
}

std::string Px(const PaperSums& sums) {
  return fmt::format("{:.3f} ({:.3f})", sums.Mean(), sums.StandardDeviation());
}

std::string Mm(const PaperSums& sums) {
  return fmt::format("{:.3f} ({:.3f})", 1e3 * sums.Mean(), 1e3 * sums.StandardDeviation());
}

std::string Figure(const PaperRealRow& row, size_t camera) {
  if (row.sd_px.empty()) return fmt::format("{:.2f}", row.mean_px[camera]);
  return fmt::format("{:.3f} ({:.3f})", row.mean_px[camera], row.sd_px[camera]);
}

// Options that have their defaults are left out.
std::string CommandOf(const PaperOptions& options, const PaperRow& row) {
  const PaperOptions defaults;
  std::string command = "rigcal-accuracy paper";
  const auto add = [&command](const char* name, double value, double usual) {
    if (value != usual) command += fmt::format(" {} {}", name, value);
  };
  add("--seeds", options.seeds, defaults.seeds);
  add("--first-seed", options.first_seed, defaults.first_seed);
  add("--duration", options.recording.duration_s, defaults.recording.duration_s);
  add("--board-rate", options.recording.board_rate_hz, defaults.recording.board_rate_hz);
  add("--board-angle", options.recording.board_angle_deg, defaults.recording.board_angle_deg);
  return command + fmt::format(" --only \"{}\"", NameOf(row));
}

std::string Failure(const PaperRow& row) {
  return fmt::format("no seed was solved: {}", row.first_failure.ToString());
}

}  // namespace

absl::StatusOr<std::vector<PaperRealRow>> RunPaperRecording(const server::CalibrationInput& input) {
  RIGCAL_ASSIGN_OR_RETURN(const CalibrationResult solved, server::Calibrate(input, {}).result);
  RIGCAL_ASSIGN_OR_RETURN(const CalibrationResult paired, SolveIndexPaired(input));
  return std::vector<PaperRealRow>{{"published", {1.38, 1.30, 3.00, 2.79}, {}},
                                   RealRow(NameOf(PaperMethod::kWandIndexPaired), paired),
                                   RealRow(NameOf(PaperMethod::kWand), solved)};
}

std::string PaperCsv(const std::vector<PaperRow>& rows) {
  std::string csv = "table,condition,method,camera,unit,mean,standard_deviation,count\n";
  const auto add = [&csv](const char* table, const PaperRow& row, std::string_view camera,
                          std::string_view unit, const PaperSums& sums) {
    csv += fmt::format("{},{},\"{}\",{},{},{:.9g},{:.9g},{:.0f}\n", table, row.condition,
                       NameOf(row.method), camera, unit, sums.Mean(), sums.StandardDeviation(),
                       sums.count);
  };
  for (const PaperRow& row : rows) {
    if (row.solved == 0) continue;
    for (const PaperCamera& camera : row.cameras) {
      add("I", row, camera.camera, "px", camera.error_px);
    }
    add("II", row, "", "m", row.path_m);
    add("II exact marker", row, "", "m", row.exact_path_m);
  }
  return csv;
}

std::string PaperText(const PaperOptions& options, const std::vector<PaperRow>& rows,
                      const std::vector<PaperRealRow>& real) {
  std::string text;
  for (const std::string& limit : Limits(options)) text += limit + "\n";
  if (!rows.empty()) {
    text += "\nTable I: reprojection error, px, mean (standard deviation)\n";
    for (const PaperRow& row : rows) {
      if (row.cameras.empty()) continue;
      text += fmt::format("{:48}", "");
      for (const PaperCamera& camera : row.cameras) text += fmt::format(" {:>14}", camera.camera);
      text += "\n";
      break;
    }
    for (const PaperRow& row : rows) {
      if (row.cameras.empty() && row.solved > 0) continue;
      text += fmt::format("{:48}", NameOf(row));
      for (const PaperCamera& camera : row.cameras) {
        text += fmt::format(" {:>14}", Px(camera.error_px));
      }
      text += row.solved == 0 ? " " + Failure(row) + "\n" : "\n";
    }
    text += "\nTable II: positions of one marker in 3-D, mm, mean (standard deviation)\n";
    text += fmt::format("{:48} {:>16} {:>16} {:>8} {:>9} {:>9} {:>7}\n", "", "error",
                        "exact marker", "points", "waved s", "instants", "solved");
    for (const PaperRow& row : rows) {
      if (row.solved == 0) continue;
      text += fmt::format("{:48} {:>16} {:>16} {:8.0f} {:9.0f} {:9.0f} {:2} of {}\n", NameOf(row),
                          Mm(row.path_m), Mm(row.exact_path_m), row.path_m.count, row.waved_s,
                          row.instants, row.solved, options.seeds);
    }
  }
  if (real.empty()) return text;
  text += "\nThe recording that was published with the paper, px, mean (standard deviation)\n";
  for (const PaperRealRow& row : real) {
    text += fmt::format("{:48}", row.method);
    for (size_t c = 0; c < row.mean_px.size(); ++c) text += fmt::format(" {:>14}", Figure(row, c));
    text += "\n";
  }
  return text;
}

std::string PaperPage(const PaperOptions& options, const std::vector<PaperRow>& rows,
                      const std::vector<PaperRealRow>& real) {
  std::string page =
      "# The tables of the eWand paper, repeated\n\n"
      "Gossard, Ziegler et al., ICRA 2024. Every row names the command that prints it.\n\n";
  for (const std::string& limit : Limits(options)) page += "- " + limit + "\n";
  if (!rows.empty()) {
    page += "\n## Table I\n\nReprojection error, px, mean (standard deviation).\n\n";
    page += "| row | frame and event cameras, by name | command |\n|---|---|---|\n";
    for (const PaperRow& row : rows) {
      if (row.cameras.empty() && row.solved > 0) continue;
      std::string figures = row.solved == 0 ? Failure(row) : "";
      for (const PaperCamera& camera : row.cameras) {
        figures +=
            fmt::format("{}{} {}", figures.empty() ? "" : ", ", camera.camera, Px(camera.error_px));
      }
      page += fmt::format("| {} | {} | `{}` |\n", NameOf(row), figures, CommandOf(options, row));
    }
    page +=
        "\n## Table II\n\nOne marker of another wand, triangulated, after a rigid motion and a "
        "time offset to its path: mm, mean (standard deviation).\n\n"
        "| row | error | exact marker | points | seconds of waving | instants used | command |\n"
        "|---|---|---|---|---|---|---|\n";
    for (const PaperRow& row : rows) {
      if (row.solved == 0) continue;
      page += fmt::format("| {} | {} | {} | {:.0f} | {:.0f} | {:.0f} | `{}` |\n", NameOf(row),
                          Mm(row.path_m), Mm(row.exact_path_m), row.path_m.count, row.waved_s,
                          row.instants, CommandOf(options, row));
    }
  }
  page += "\n## The recording that was published with the paper\n\n";
  if (real.empty()) return page + "It was not asked for, or is not there: `--data DIR` names it.\n";
  page +=
      "Reprojection error, px, mean (standard deviation); "
      "`rigcal-accuracy paper --only recording`.\n\n| row |";
  for (size_t c = 0; c < real.front().mean_px.size(); ++c) page += fmt::format(" frame_{} |", c);
  page += "\n|---|";
  for (size_t c = 0; c < real.front().mean_px.size(); ++c) page += "---|";
  for (const PaperRealRow& row : real) {
    page += fmt::format("\n| {} |", row.method);
    for (size_t c = 0; c < row.mean_px.size(); ++c) page += fmt::format(" {} |", Figure(row, c));
  }
  return page + "\n";
}

}  // namespace rigcal::accuracy

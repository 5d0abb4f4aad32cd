// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/paper/paper_report.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string_view>

#include "absl/strings/escaping.h"
#include "common/identity/private_key.h"
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

// Of points: what they are drawn with.
std::vector<std::string> PointLimits(const PaperRecordingOptions& recording) {
  const auto noise = [](PaperTarget target) {
    return fmt::format("{} and {}", NoiseOf(target).frame_px, NoiseOf(target).event_px);
  };
  return {
      "Simulated points, not pixels: nothing is rendered or detected.",
      fmt::format("One sigma of a coordinate, px, in frame and event cameras: wand {}, circles {}, "
                  "checkerboard {}.",
                  noise(PaperTarget::kWand), noise(PaperTarget::kCircles),
                  noise(PaperTarget::kChecker)),
      "Those of boards in frame cameras were measured of boards 0.5 to 0.8 m away that stand "
      "still: too good for boards that are waved 2 to 6 m away. That of a checkerboard in an event "
      "camera is a stand-in: the one of printed circles. A print's common shift is left out.",
      fmt::format("A board is seen whole, and where its front points to the camera by less than {} "
                  "degrees. 2 % of all views are missed. There are no outliers.",
                  recording.board_angle_deg),
      "\"boards noisy as the wand\": points of boards have the noise of the wand's centres.",
      "\"exact marker\": its centres have no noise, the error is that of the calibration alone.",
  };
}

// Of pictures and events: how they come about.
std::vector<std::string> RenderedLimits(const PaperRecordingOptions& recording) {
  return {
      "Rendered: pictures and events are simulated from light on and pass the detectors of an "
      "agent. Lenses are exactly as given.",
      "Frames are exposed for 2 ms, one blink. The wand (LEDs of 500.1 Hz, said to be 500) is in "
      "the detection experiments' office, boards are before a plain wall with noise of 2 grey "
      "levels, a frame of a board that moves is the mean of up to four pictures.",
      fmt::format("A printed circle board before an event camera is searched for while its front "
                  "points to the camera by less than {} degrees, with noise of 1 Hz a pixel (the "
                  "wand: 5 Hz, clutter, lamps). rigcal has no detector of checkerboards in events.",
                  recording.board_angle_deg),
      fmt::format("\"not seen\": the target is found in fewer than {} views; that camera is not "
                  "calibrated, and takes no part in Table II.",
                  kPaperLeastViews),
      "\"exact marker\": its centres are exact, in the frame cameras alone, which all methods "
      "calibrate: the error is that of the calibration.",
  };
}

// What is simulated, a stand-in or missing; a line for each.
std::vector<std::string> Limits(const PaperOptions& options) {
  const PaperRecordingOptions& recording = options.recording;
  std::vector<std::string> limits =
      options.points ? PointLimits(recording) : RenderedLimits(recording);
  const std::vector<std::string> both = {
      fmt::format("Seeds {} to {}: a rig is drawn for each. Every target is waved for {} s along "
                  "the same path. A wand is seen 50 times a second, a board {} times.",
                  options.first_seed, options.first_seed + options.seeds - 1, recording.duration_s,
                  kPaperTriggerHz / BoardFrameStep(recording)),
      "The event cameras give a wand 50 times a second, at the trigger: the row that is paired by "
      "index needs that, and takes each centre as seen at the trigger.",
      "Targets are exactly as given; \"targets as built\": each span of the wand is off by 0.1 mm, "
      "each coordinate of a board's points by 0.3 mm (one sigma). Boards are held as given.",
      fmt::format("A board turns once around the vertical in {} s, so that every camera has its "
                  "turn, and swings by 34 degrees.",
                  recording.board_turn_s),
      "\"frame_0 8 ms early\": it is exposed 8 ms before the others, all stamps say together. "
      "\"frame_1 bumped later\": moved by 5 mm and turned by 0.3 degrees between the calibration "
      "and the marker of Table II; nobody calibrated again.",
      "\"the true rig\" is not calibrated: what the marker's own errors leave in Table II.",
      "\"enough\": seconds of waving from which on the exact marker's error stays within 1.2 of "
      "that after all of it, of the shares 1/8, 1/4, 3/8, 1/2, 3/4 and 1.",
      "\"paired by index\" is our reading of the paper's description, not its program. "
      "\"stand-in for kalibr\" is our reading of its method, not kalibr: a B-spline of the board's "
      "pose, Cauchy's loss, all cameras' offsets (spline_solve.h). Both start from pairs of "
      "cameras.",
  };
  limits.insert(limits.end(), both.begin(), both.end());
  return limits;
}

std::string Px(const PaperSums& sums) {
  return fmt::format("{:.3f} ({:.3f})", sums.Mean(), sums.StandardDeviation());
}

std::string Mm(const PaperSums& sums) {
  return fmt::format("{:.3f} ({:.3f})", 1e3 * sums.Mean(), 1e3 * sums.StandardDeviation());
}

std::string CameraFigure(const PaperCamera& camera) {
  if (camera.error_px.count == 0) return fmt::format("not seen ({})", camera.views);
  return Px(camera.error_px);
}

std::string Enough(const PaperRow& row) {
  const std::optional<double> enough_s = EnoughWavingS(row);
  return enough_s ? fmt::format("{:.1f}", *enough_s) : "";
}

std::string Figure(const PaperRealRow& row, size_t camera) {
  if (row.sd_px.empty()) return fmt::format("{:.2f}", row.mean_px[camera]);
  return fmt::format("{:.3f} ({:.3f})", row.mean_px[camera], row.sd_px[camera]);
}

// Options that have their defaults are left out.
std::string CommandOf(const PaperOptions& options, const PaperRow& row) {
  const PaperOptions defaults;
  std::string command = "rigcal-accuracy paper";
  if (options.points) command += " --points";
  const auto add = [&command](const char* name, double value, double usual) {
    if (value != usual) command += fmt::format(" {} {}", name, value);
  };
  add("--seeds", options.seeds, defaults.seeds);
  add("--first-seed", options.first_seed, defaults.first_seed);
  add("--duration", options.recording.duration_s, defaults.recording.duration_s);
  add("--path", options.recording.path_s, defaults.recording.path_s);
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
  const auto add = [&csv](const std::string& table, const PaperRow& row, std::string_view camera,
                          std::string_view unit, const PaperSums& sums) {
    const double scale = unit == "mm" ? 1e3 : 1;
    csv += fmt::format("{},{},\"{}\",{},{},{:.3f},{:.3f},{:.0f}\n", table, row.condition,
                       NameOf(row.method), camera, unit, scale * sums.Mean(),
                       scale * sums.StandardDeviation(), sums.count);
  };
  for (const PaperRow& row : rows) {
    if (row.solved == 0) continue;
    for (const PaperCamera& camera : row.cameras) {
      if (camera.error_px.count > 0) add("I", row, camera.camera, "px", camera.error_px);
      csv += fmt::format("views,{},\"{}\",{},,,,{}\n", row.condition, NameOf(row.method),
                         camera.camera, camera.views);
    }
    add("II", row, "", "mm", row.path_m);
    add("II exact marker", row, "", "mm", row.exact_path_m);
    for (const PaperShorterWave& shorter : row.course) {
      if (shorter.solved == 0) continue;
      add(fmt::format("II exact marker after {} s", shorter.waved_s), row, "", "mm",
          shorter.exact_path_m);
    }
  }
  return csv;
}

std::string PaperDigest(const std::vector<PaperRow>& rows) {
  return absl::BytesToHexString(Sha256(PaperCsv(rows)));
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
        text += fmt::format(" {:>14}", CameraFigure(camera));
      }
      text += row.solved == 0 ? " " + Failure(row) + "\n" : "\n";
    }
    text += "\nTable II: positions of one marker in 3-D, mm, mean (standard deviation)\n";
    text += fmt::format("{:48} {:>16} {:>16} {:>8} {:>9} {:>9} {:>9} {:>7}\n", "", "error",
                        "exact marker", "points", "waved s", "enough s", "instants", "solved");
    for (const PaperRow& row : rows) {
      if (row.solved == 0) continue;
      text += fmt::format("{:48} {:>16} {:>16} {:8.0f} {:9.0f} {:>9} {:9.0f} {:2} of {}\n",
                          NameOf(row), Mm(row.path_m), Mm(row.exact_path_m), row.path_m.count,
                          row.waved_s, Enough(row), row.instants, row.solved, options.seeds);
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
                      const std::vector<PaperRealRow>& real, const std::string& figure) {
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
        figures += fmt::format("{}{} {}", figures.empty() ? "" : ", ", camera.camera,
                               CameraFigure(camera));
      }
      page += fmt::format("| {} | {} | `{}` |\n", NameOf(row), figures, CommandOf(options, row));
    }
    page +=
        "\n## Table II\n\nOne marker of another wand, triangulated, after a rigid motion and a "
        "time offset to its path: mm, mean (standard deviation).\n\n"
        "| row | error | exact marker | points | seconds of waving | enough | instants used | "
        "command "
        "|\n|---|---|---|---|---|---|---|---|\n";
    for (const PaperRow& row : rows) {
      if (row.solved == 0) continue;
      page += fmt::format("| {} | {} | {} | {:.0f} | {:.0f} | {} | {:.0f} | `{}` |\n", NameOf(row),
                          Mm(row.path_m), Mm(row.exact_path_m), row.path_m.count, row.waved_s,
                          Enough(row), row.instants, CommandOf(options, row));
    }
  }
  if (!figure.empty()) {
    page += fmt::format(
        "\n## Error by seconds of waving\n\nOf the calibration alone (exact marker), condition "
        "\"{}\".\n\n![Error of a point in 3-D against seconds of waving, a curve for each "
        "method]({})\n",
        kPaperConditions[0].name, figure);
  }
  page +=
      "\nThe paper's detection rates (against ambient light, and against blink frequency) were "
      "published as figures only; `rigcal-accuracy ambient_light` and `blink_frequency` draw "
      "rigcal's.\n";
  if (!rows.empty()) page += fmt::format("\nSHA-256 of the CSV: `{}`\n", PaperDigest(rows));
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

// SPDX-License-Identifier: Apache-2.0
#include "agent/command/lens_report.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace rigcal::agent {
namespace {

// JSON has no infinity.
nlohmann::ordered_json Finite(double value) {
  return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json(nullptr);
}

std::string EventLine(const EventBoardCounts& counts) {
  std::string text = absl::StrFormat("events        %u", counts.events);
  if (counts.blink_hz > 0) {
    absl::StrAppendFormat(&text, "; the board blinks at %.2f Hz, shown and hidden",
                          counts.blink_hz);
  } else {
    absl::StrAppend(&text, "; nothing blinks, so of what moves");
  }
  if (counts.flicker_hz > 0) {
    absl::StrAppendFormat(&text, "; backlight, refresh or a lamp flickers at %.1f Hz",
                          counts.flicker_hz);
  }
  return text + "\n";
}

}  // namespace

std::string FormatLensReport(const Board& board, const BoardViews& views,
                             const LensSolution& solution, const std::string& output) {
  const Intrinsics& lens = solution.intrinsics;
  std::string text;
  absl::StrAppendFormat(&text, "camera        %s, %d x %d px, %s\n", views.camera,
                        views.image_size_px.width, views.image_size_px.height, FormatBoard(board));
  absl::StrAppendFormat(&text, "pictures      %d, %d with the board", views.pictures,
                        views.with_board);
  if (views.alike + views.blurred > 0) {
    absl::StrAppendFormat(&text, " (not taken: %d as another one, %d blurred)", views.alike,
                          views.blurred);
  }
  absl::StrAppendFormat(&text, "; %d views and %d corners used\n", solution.views,
                        solution.corners);
  for (const Refusal& refusal : views.refused) {
    absl::StrAppendFormat(&text, "not read      %d: %s%s\n", refusal.count, refusal.example,
                          refusal.count > 1 ? ", and others like it" : "");
  }
  if (views.events) text += EventLine(*views.events);
  absl::StrAppendFormat(&text, "model         %s (%s); held-out error of each, px:",
                        std::string(LensModelName(solution.model)),
                        std::string(DistortionModelName(lens.model)));
  for (const LensCandidate& candidate : solution.candidates) {
    absl::StrAppendFormat(&text, " %s %.3f", std::string(LensModelName(candidate.model)),
                          candidate.held_out_rms_px);
  }
  absl::StrAppendFormat(&text,
                        "\nfocal length  %.2f, %.2f px (sigma %.2f, %.2f); middle %.2f, %.2f px "
                        "(sigma %.2f, %.2f)\n",
                        lens.fx_px, lens.fy_px, solution.sigmas[0], solution.sigmas[1], lens.cx_px,
                        lens.cy_px, solution.sigmas[2], solution.sigmas[3]);
  absl::StrAppendFormat(&text, "error         %.3f px RMS, %.3f px in views that were held out\n",
                        solution.rms_px, solution.held_out_rms_px);
  absl::StrAppendFormat(
      &text, "uncertainty   %.3f px (median), %.3f px (95 %% of the image) by noise alone\n",
      solution.uncertainty.median_px, solution.uncertainty.p95_px);
  if (solution.halves) {
    absl::StrAppendFormat(
        &text,
        "              two halves of the views differ by %.3f px (median), %.3f px "
        "(95 %% of the image)\n",
        solution.halves->median_px, solution.halves->p95_px);
  }
  absl::StrAppendFormat(&text, "coverage      corners in %.0f %% of the image\n",
                        100 * solution.covered_share);
  if (solution.bend) {
    absl::StrAppendFormat(
        &text,
        "board         bent by %.2f mm along its rows and %.2f mm along its columns, "
        "from the middle to the border (sigma %.2f, %.2f)\n",
        1e3 * solution.bend->height_m.x(), 1e3 * solution.bend->height_m.y(),
        1e3 * solution.bend->sigma_m.x(), 1e3 * solution.bend->sigma_m.y());
  }
  for (const LensViewResult& view : solution.view_results) {
    if (view.left_out.empty()) continue;
    absl::StrAppendFormat(&text, "left out      %s: %s\n", view.name, view.left_out);
  }
  for (const std::string& advice : solution.advice) {
    absl::StrAppendFormat(&text, "better        %s\n", advice);
  }
  if (!output.empty()) {
    absl::StrAppendFormat(&text, "written       %s, for calibration=%s of a source\n", output,
                          output);
  }
  return text;
}

std::string LensReportJson(const Board& board, const BoardViews& views,
                           const LensSolution& solution, const std::string& output) {
  const Intrinsics& lens = solution.intrinsics;
  using Json = nlohmann::ordered_json;
  Json json = {{"board", FormatBoard(board)},
               {"camera", views.camera},
               {"image_size_px", {views.image_size_px.width, views.image_size_px.height}},
               {"pictures", views.pictures},
               {"with_board", views.with_board},
               {"views", solution.views},
               {"corners", solution.corners},
               {"model", std::string(LensModelName(solution.model))},
               {"intrinsics",
                {{"distortion_model", std::string(DistortionModelName(lens.model))},
                 {"fx_px", lens.fx_px},
                 {"fy_px", lens.fy_px},
                 {"cx_px", lens.cx_px},
                 {"cy_px", lens.cy_px},
                 {"distortion", lens.distortion}}},
               {"sigmas", Json::array()},
               {"noise_px", solution.noise_px},
               {"rms_px", solution.rms_px},
               {"held_out_rms_px", solution.held_out_rms_px},
               {"candidates", Json::array()},
               {"uncertainty",
                {{"median_px", Finite(solution.uncertainty.median_px)},
                 {"p95_px", Finite(solution.uncertainty.p95_px)}}},
               {"uncertainty_map_px",
                {{"columns", LensDifference::kColumns},
                 {"rows", LensDifference::kRows},
                 {"values", Json::array()}}},
               {"halves", nullptr},
               {"board_bend", nullptr},
               {"covered_share", solution.covered_share},
               {"blind_share", solution.blind_share},
               {"view_results", Json::array()},
               {"not_read", Json::array()},
               {"advice", solution.advice},
               {"file", output}};
  if (views.events) {
    json["events"] = {{"count", views.events->events},
                      {"bursts", views.events->bursts},
                      {"blink_hz", views.events->blink_hz},
                      {"flicker_hz", views.events->flicker_hz}};
  }
  for (const double sigma : solution.sigmas) json["sigmas"].push_back(Finite(sigma));
  Json& values = json["uncertainty_map_px"]["values"];
  for (const double sigma : solution.uncertainty.map_px) values.push_back(Finite(sigma));
  for (const LensCandidate& candidate : solution.candidates) {
    json["candidates"].push_back({{"model", std::string(LensModelName(candidate.model))},
                                  {"rms_px", candidate.rms_px},
                                  {"held_out_rms_px", candidate.held_out_rms_px}});
  }
  if (solution.halves) {
    json["halves"] = {{"median_px", solution.halves->median_px},
                      {"p95_px", solution.halves->p95_px},
                      {"most_px", solution.halves->most_px},
                      {"unknown_share", solution.halves->unknown_share}};
  }
  if (solution.bend) {
    json["board_bend"] = {{"height_m", {solution.bend->height_m.x(), solution.bend->height_m.y()}},
                          {"sigma_m", {solution.bend->sigma_m.x(), solution.bend->sigma_m.y()}}};
  }
  for (const LensViewResult& view : solution.view_results) {
    json["view_results"].push_back({{"name", view.name},
                                    {"corners", view.corners},
                                    {"left_out_corners", view.left_out_corners},
                                    {"rms_px", view.rms_px},
                                    {"tilt_deg", view.tilt_deg},
                                    {"left_out", view.left_out}});
  }
  for (const Refusal& refusal : views.refused) {
    json["not_read"].push_back({{"reason", std::string(NameOf(refusal.reason))},
                                {"count", refusal.count},
                                {"example", refusal.example}});
  }
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace rigcal::agent

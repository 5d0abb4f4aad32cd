// SPDX-License-Identifier: Apache-2.0
#include "client/commands/scale_command.h"

#include <algorithm>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "client/commands/command_parser.h"
#include "client/commands/fetch_calibration.h"
#include "client/output/output.h"
#include "client/results/calibration_file.h"
#include "client/results/marker_rows.h"
#include "client/results/scale_report.h"
#include "client/results/triangulation_file.h"
#include "common/scale/scale_fusion.h"
#include "common/status/status_macros.h"

namespace rigcal::client {
namespace {

constexpr double kDefaultDistanceSigmaM = 0.002;
constexpr double kDefaultLengthSigmaM = 0.0005;

// "A,B,METRES" or "A,B,METRES,SIGMA_M".
struct GivenLength {
  std::string a, b;
  double length_m = 0, sigma_m = 0;
};

absl::StatusOr<GivenLength> ParseLength(const std::string& text, double default_sigma_m) {
  const std::vector<std::string> parts = absl::StrSplit(text, ',');
  GivenLength given;
  given.sigma_m = default_sigma_m;
  const bool valid = (parts.size() == 3 || parts.size() == 4) &&
                     absl::SimpleAtod(parts[2], &given.length_m) && given.length_m > 0 &&
                     given.length_m < 1e6 &&
                     (parts.size() == 3 || (absl::SimpleAtod(parts[3], &given.sigma_m) &&
                                            given.sigma_m > 0 && given.sigma_m < given.length_m));
  if (!valid) {
    return absl::InvalidArgumentError(absl::StrCat(
        "'", text, "' is not two names, metres and one sigma in metres, like a,b,1.25,0.001"));
  }
  given.a = parts[0];
  given.b = parts[1];
  return given;
}

absl::StatusOr<int> MarkerOf(const std::vector<std::string>& labels, const std::string& label) {
  const auto found = std::ranges::find(labels, label);
  if (found != labels.end()) return static_cast<int>(found - labels.begin());
  return absl::InvalidArgumentError(
      absl::StrCat("the rows have no marker ", label, "; they have ", labels.front(), " to ",
                   labels.back(), ", counted as in the rows where the target names none"));
}

absl::Status AddLengths(const CalibrationResult& calibration, const CameraCovariance& covariance,
                        const ScaleCommandOptions& options, CommandContext& context,
                        std::vector<ScaleSource>* sources) {
  if (options.lengths.empty()) return absl::OkStatus();
  std::vector<std::string> names;
  for (const CalibratedCamera& camera : calibration.cameras) names.push_back(camera.camera);
  RIGCAL_ASSIGN_OR_RETURN(MarkerRows rows, ReadMarkerRows(options.data, names));
  for (const std::string& warning : rows.warnings) context.console.Message(warning);
  const std::vector<std::string> labels =
      MarkerLabels(calibration.target.given, rows.cameras.front().rows.front().markers.size());
  TriangulationOptions triangulation_options;
  triangulation_options.sigma_px = options.sigma_px;
  triangulation_options.diameter_m = calibration.target.given.diameter_m;
  RIGCAL_ASSIGN_OR_RETURN(
      const Triangulation triangulation,
      TriangulateRows(calibration, std::move(rows.cameras), triangulation_options));
  for (const std::string& text : options.lengths) {
    RIGCAL_ASSIGN_OR_RETURN(const GivenLength given, ParseLength(text, kDefaultLengthSigmaM));
    RIGCAL_ASSIGN_OR_RETURN(const int a, MarkerOf(labels, given.a));
    RIGCAL_ASSIGN_OR_RETURN(const int b, MarkerOf(labels, given.b));
    RIGCAL_ASSIGN_OR_RETURN(ScaleSource source,
                            ScaleOfMarkers(calibration, covariance, triangulation, a, b,
                                           given.length_m, given.sigma_m));
    source.name = absl::StrCat("length ", given.a, " to ", given.b);
    sources->push_back(std::move(source));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<ScaleSource>> SourcesOf(const CalibrationResult& calibration,
                                                   const CameraCovariance& covariance,
                                                   const ScaleCommandOptions& options,
                                                   CommandContext& context) {
  std::vector<ScaleSource> sources;
  if (absl::StatusOr<ScaleSource> target = ScaleOfTarget(calibration); target.ok()) {
    sources.push_back(*std::move(target));
  } else {
    context.console.Message(std::string(target.status().message()));
  }
  for (const std::string& text : options.distances) {
    RIGCAL_ASSIGN_OR_RETURN(const GivenLength given, ParseLength(text, kDefaultDistanceSigmaM));
    RIGCAL_ASSIGN_OR_RETURN(
        ScaleSource source,
        ScaleOfCameras(calibration, covariance, given.a, given.b, given.length_m, given.sigma_m));
    sources.push_back(std::move(source));
  }
  RIGCAL_RETURN_IF_ERROR(AddLengths(calibration, covariance, options, context, &sources));
  for (const std::string& name : options.leave_out) {
    const auto removed =
        std::erase_if(sources, [&name](const ScaleSource& source) { return source.name == name; });
    if (removed == 0) {
      return absl::InvalidArgumentError(absl::StrCat("there is no source \"", name, "\""));
    }
  }
  if (sources.empty()) return absl::InvalidArgumentError("no source of the scale is left");
  return sources;
}

absl::StatusOr<ScaleReport> MakeScale(const ScaleCommandOptions& options, CommandContext& context) {
  RIGCAL_ASSIGN_OR_RETURN(CalibrationFile file, FetchCalibrationFile(options.calibration, context));
  RIGCAL_ASSIGN_OR_RETURN(const CalibrationResult calibration, ResultOf(file));
  if (!calibration.scale_known) {
    return absl::FailedPreconditionError(
        "the calibration's own scale is not known; calibrate with --distance first");
  }
  const CameraCovariance covariance = UnpackCameraCovariance(calibration);
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<ScaleSource> sources,
                          SourcesOf(calibration, covariance, options, context));
  ScaleReport report;
  report.calibration = options.calibration;
  report.fusion = FuseScales(sources, covariance);
  if (report.fusion.odd >= 0 || report.fusion.undecided) return report;
  SetResult(Rescale(calibration, report.fusion.factor, report.fusion.sigma_rel), &file);
  RIGCAL_RETURN_IF_ERROR(ReplaceFile(options.output, CalibrationText(file)));
  report.output = options.output;
  return report;
}

}  // namespace

ExitCode FuseScale(const ScaleCommandOptions& options, CommandContext& context) {
  const absl::StatusOr<ScaleReport> report = MakeScale(options, context);
  const ExitCode code = context.Show(report, FormatScale);
  if (code != ExitCode::kOk || !report->output.empty()) return code;
  return context.Fail(absl::FailedPreconditionError(DisagreementOf(report->fusion)));
}

void AddScaleCommand(CommandParser& parser, CLI::App* group) {
  auto [app, options] = parser.AddCommand(
      group, "scale", "The scale of a calibration from several measured lengths together",
      FuseScale);
  AddArgument(app, "CALIBRATION",
              "Id of a calibration, or the path (with a . or /) of an exported calibration.json",
              &options->calibration);
  AddOption(app, "--output", "FILE", &options->output, "calibration.json to write")->required();
  const auto add_list = [app = app](const char* name, const char* type,
                                    std::vector<std::string>* values, const std::string& what) {
    return AddOption(app, name, type, values, what)
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  };
  add_list("--distance", "CAMERA,CAMERA,METRES[,SIGMA_M]", &options->distances,
           "Measured distance between the optical centres of two cameras, and its one sigma "
           "(default 0.002); may be repeated");
  CLI::Option* const lengths = add_list(
      "--length", "MARKER,MARKER,METRES[,SIGMA_M]", &options->lengths,
      "Measured length between two markers of the rows in --data, such as the ends of a scale bar, "
      "and its one sigma (default 0.0005); may be repeated");
  lengths->needs(AddOption(app, "--data", "DIR", &options->data, "Folder of rows"));
  add_list("--leave-out", "NAME", &options->leave_out,
           "Without this source, named as in the report (\"the target\"); may be repeated");
  AddOption(app, "--sigma-px", "PX", &options->sigma_px,
            "One sigma of each coordinate of a centre, pixels; without it as the calibration's "
            "residuals scatter")
      ->check(NumberBetween(1e-3, 100));
}

}  // namespace rigcal::client

// SPDX-License-Identifier: Apache-2.0
#include "client/commands/scale_command.h"

#include <algorithm>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "client/commands/calibrate_command.h"
#include "client/commands/command_parser.h"
#include "client/commands/fetch_calibration.h"
#include "client/net/server_connection.h"
#include "client/output/output.h"
#include "client/results/calibration_file.h"
#include "client/results/scale_report.h"
#include "client/results/triangulation_file.h"
#include "common/file/durable_file.h"
#include "common/file/may_write.h"
#include "common/scale/solve_scale.h"
#include "common/scale/unit_ratio.h"
#include "common/status/status_macros.h"
#include "common/wire/camera_wire.h"
#include "rigcal/v1/session_service.grpc.pb.h"

namespace rigcal::client {
namespace {

// Of one length, sent to the server; written to a file, all of them count.
constexpr size_t kMaxSentPairs = 500, kMaxPairs = 20'000;

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

// What the options mean; markers are named by `labels`.
absl::StatusOr<ScaleRequest> RequestFrom(const ScaleCommandOptions& options,
                                         const std::vector<std::string>& labels) {
  ScaleRequest request;
  for (const std::string& text : options.distances) {
    RIGCAL_ASSIGN_OR_RETURN(const GivenLength given,
                            ParseLength(text, CameraDistance::kDefaultSigmaM));
    request.distances.push_back({given.a, given.b, given.length_m, given.sigma_m});
  }
  for (const std::string& text : options.lengths) {
    RIGCAL_ASSIGN_OR_RETURN(const GivenLength given,
                            ParseLength(text, KnownLength::kDefaultSigmaM));
    RIGCAL_ASSIGN_OR_RETURN(const int a, MarkerOf(labels, given.a));
    RIGCAL_ASSIGN_OR_RETURN(const int b, MarkerOf(labels, given.b));
    request.lengths.push_back(
        {a, b, given.length_m, given.sigma_m, absl::StrCat("length ", given.a, " to ", given.b)});
  }
  request.leave_out = options.leave_out;
  RIGCAL_RETURN_IF_ERROR(request.Validate());
  return request;
}

// Names of the markers of the session's target.
absl::StatusOr<std::vector<std::string>> LabelsOfSession(const std::string& session,
                                                         CommandContext& context) {
  ServerConnection server(context.server);
  const auto found = SessionOf(server.CallWithId(&v1::SessionService::Stub::GetSession, session));
  if (!found.ok()) return found.status();
  RIGCAL_ASSIGN_OR_RETURN(const Target target, wire::FromProto(found->target()));
  return MarkerLabels(target, static_cast<size_t>(target.marker_count()));
}

// The request with what the rows of the folder show of its lengths.
absl::StatusOr<ScaleRequest> WithFolder(const CalibrationResult& calibration,
                                        const ScaleCommandOptions& options, size_t max_pairs,
                                        CommandContext& context) {
  if (options.lengths.empty()) return RequestFrom(options, {});
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<CameraRows> rows,
                          FolderRows(calibration, options.data, context));
  const std::vector<std::string> labels =
      MarkerLabels(calibration.target.given, rows.front().rows.front().markers.size());
  RIGCAL_ASSIGN_OR_RETURN(ScaleRequest request, RequestFrom(options, labels));
  TriangulationOptions triangulation;
  triangulation.sigma_px = options.sigma_px;
  triangulation.diameter_m = calibration.target.given.diameter_m;
  RIGCAL_ASSIGN_OR_RETURN(request.measured,
                          MeasureForScale(calibration, request, rows, triangulation, max_pairs));
  return request;
}

absl::StatusOr<ScaleReport> WriteScale(const std::string& which, const ScaleCommandOptions& options,
                                       CommandContext& context) {
  RIGCAL_RETURN_IF_ERROR(CheckOutputFile(options.target.output, options.target.force));
  RIGCAL_ASSIGN_OR_RETURN(CalibrationFile file, FetchCalibrationFile(which, context));
  RIGCAL_ASSIGN_OR_RETURN(const CalibrationResult calibration, ResultOf(file));
  RIGCAL_ASSIGN_OR_RETURN(const ScaleRequest request,
                          WithFolder(calibration, options, kMaxPairs, context));
  ScaleReport report;
  report.calibration = which;
  RIGCAL_ASSIGN_OR_RETURN(report.fusion, FuseSources(calibration, request, request.measured));
  if (report.fusion.odd >= 0 || report.fusion.undecided) return report;
  SetResult(WithScale(calibration, file.calibration.id(), report.fusion), &file);
  RIGCAL_RETURN_IF_ERROR(WriteOutputFile(options.target.output, CalibrationText(file)));
  report.output = options.target.output;
  return report;
}

// Nothing contradicts a single length, and nobody's calibration is a thousand times too small.
void WarnOfUnits(const ScaleReport& report, CommandContext& context) {
  const double factor = report.fusion.factor;
  if (report.output.empty()) return;
  if (const std::string unit = UnitOfRatio(factor, 0.1); !unit.empty()) {
    context.console.Message(absl::StrCat("every length became ", DescribeRatio(factor),
                                         ": is what was given in ", unit, "? Give metres"));
  } else if (const std::string other = UnitOfRatio(1 / factor, 0.1); !other.empty()) {
    context.console.Message(absl::StrCat("every length became ", DescribeRatio(factor), ": ",
                                         report.calibration, " was in ", other, ", it seems"));
  }
}

absl::StatusOr<v1::CreateCalibrationRequest> ServerScaleRequest(const std::string& which,
                                                                const ScaleCommandOptions& options,
                                                                CommandContext& context) {
  CalibrationOptions calibration_options;
  calibration_options.kind = SolveKind::kScale;
  calibration_options.parent_id = which;
  calibration_options.sigma_px = options.sigma_px;
  if (!options.target.session.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(const std::vector<std::string> labels,
                            LabelsOfSession(options.target.session, context));
    RIGCAL_ASSIGN_OR_RETURN(calibration_options.scale, RequestFrom(options, labels));
  } else if (options.lengths.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(calibration_options.scale, RequestFrom(options, {}));
  } else {
    RIGCAL_ASSIGN_OR_RETURN(const CalibrationFile file, FetchCalibrationFile(which, context));
    RIGCAL_ASSIGN_OR_RETURN(const CalibrationResult calibration, ResultOf(file));
    RIGCAL_ASSIGN_OR_RETURN(calibration_options.scale,
                            WithFolder(calibration, options, kMaxSentPairs, context));
  }
  return MakeCalibrationRequest({}, calibration_options);
}

}  // namespace

ExitCode FuseScale(const ScaleCommandOptions& options, CommandContext& context) {
  const absl::StatusOr<std::string> which = WhichCalibration(options.target, context);
  if (!which.ok()) return context.Fail(which.status());
  if (options.target.output.empty()) {
    absl::StatusOr<v1::CreateCalibrationRequest> create =
        ServerScaleRequest(*which, options, context);
    if (!create.ok()) return context.Fail(create.status());
    return DeriveOnServer(options.target, *which, *std::move(create), context);
  }
  const absl::StatusOr<ScaleReport> report = WriteScale(*which, options, context);
  const ExitCode code = context.Show(report, FormatScale);
  if (report.ok()) WarnOfUnits(*report, context);
  if (code != ExitCode::kOk || !report->output.empty()) return code;
  return context.Fail(absl::FailedPreconditionError(
      absl::StrCat(DisagreementOf(report->fusion), "; nothing was written")));
}

void AddScaleCommand(CommandParser& parser, CLI::App* group, bool rig) {
  auto [app, options] = parser.AddCommand(
      group, "scale",
      rig ? "The scale of the active calibration of a rig from several measured lengths together"
          : "The scale of a calibration from several measured lengths together",
      FuseScale);
  AddFrameTarget(app, rig, &options->target);
  const auto add_list = [app = app](const char* name, const char* type,
                                    std::vector<std::string>* values, const std::string& what) {
    return AddOption(app, name, type, values, what)
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  };
  add_list("--distance", "CAMERA,CAMERA,METRES[,SIGMA_M]", &options->distances,
           "Measured distance between the optical centres of two cameras, and its one sigma "
           "(default 0.002); may be repeated");
  add_list(
      "--length", "MARKER,MARKER,METRES[,SIGMA_M]", &options->lengths,
      "Measured length between two markers of the rows in --data or --session, such as the ends of "
      "a scale bar, and its one sigma (default 0.0005); may be repeated");
  AddOption(app, "--data", "DIR", &options->data, "Folder of rows")
      ->needs("--length")
      ->excludes("--session");
  add_list("--leave-out", "NAME", &options->leave_out,
           "Without this source, named as in the report (\"the target\"); may be repeated");
  AddOption(app, "--sigma-px", "PX", &options->sigma_px,
            "One sigma of each coordinate of a centre, pixels; without it as the calibration's "
            "residuals scatter")
      ->check(NumberBetween(1e-3, 100));
  app->parse_complete_callback([options = options] {
    const bool has_rows = !options->data.empty() || !options->target.session.empty();
    if (options->lengths.empty() != !has_rows) {
      throw CLI::ValidationError("--length",
                                 "needs rows, of --data or --session, and they need it");
    }
  });
}

}  // namespace rigcal::client

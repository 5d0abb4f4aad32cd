// SPDX-License-Identifier: Apache-2.0
#include <map>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "client/commands/command_parser.h"

namespace rigcal::client {
namespace {

void AddEstimateOption(CLI::App* app, const std::string& name, const std::string& what,
                       Estimate* estimate) {
  static const std::map<std::string, Estimate> words = {
      {"fixed", Estimate::kFixed}, {"refined", Estimate::kRefined}, {"auto", Estimate::kAuto}};
  app->add_option_function<std::string>(
         name, [estimate](const std::string& word) { *estimate = words.at(word); },
         absl::StrCat(what,
                      ": keep as given, estimate, or estimate where held-out data says that "
                      "it pays"))
      ->type_name("fixed|refined|auto")
      ->check(CLI::IsMember({"fixed", "refined", "auto"}).description(""));
}

void AddTrajectoryOption(CLI::App* app, TrajectoryChoice* trajectory) {
  static const std::map<std::string, TrajectoryChoice> words = {
      {"auto", TrajectoryChoice::kAuto},
      {"interpolated", TrajectoryChoice::kInterpolated},
      {"spline", TrajectoryChoice::kSpline}};
  app->add_option_function<std::string>(
         "--trajectory", [trajectory](const std::string& word) { *trajectory = words.at(word); },
         "Motion of the target between rows: rows are moved to common instants, or a spline of its "
         "path is solved with the rig; without it a spline where that may help, and held-out data "
         "agree")
      ->type_name("auto|interpolated|spline")
      ->check(CLI::IsMember({"auto", "interpolated", "spline"}).description(""));
}

// "A,B,METRES" or "A,B,METRES,SIGMA_M".
absl::StatusOr<KnownDistance> ParseDistance(const std::string& text) {
  const std::vector<std::string> parts = absl::StrSplit(text, ',');
  if (parts.size() != 3 && parts.size() != 4) {
    return absl::InvalidArgumentError(
        "wants two cameras and metres between them, like cam0,cam1,1.25 or cam0,cam1,1.25,0.001");
  }
  KnownDistance known;
  known.camera_a = parts[0];
  known.camera_b = parts[1];
  if (!absl::SimpleAtod(parts[2], &known.distance_m)) {
    return absl::InvalidArgumentError("'" + parts[2] + "' is not a number");
  }
  if (parts.size() == 4 && !(absl::SimpleAtod(parts[3], &known.sigma_m) && known.sigma_m > 0)) {
    return absl::InvalidArgumentError("the sigma '" + parts[3] +
                                      "' is not a positive number of metres");
  }
  CalibrationOptions options;
  options.known_distance = known;
  const absl::Status status = options.Validate();
  return status.ok() ? absl::StatusOr<KnownDistance>(known) : status;
}

}  // namespace

CLI::Validator NumberBetween(double low, double high) {
  return CLI::Validator(
      [low, high](std::string& text) -> std::string {
        double value = 0;
        // Written so that NaN fails.
        if (absl::SimpleAtod(text, &value) && value >= low && value <= high) return "";
        return absl::StrCat("'", text, "' is not a number from ", low, " to ", high);
      },
      "");
}

void AddForceOption(CLI::App* app, bool* force) {
  app->add_flag("--force", *force, "Replace files that exist; without it they stay");
}

void AddYesOption(CLI::App* app, bool* yes) {
  app->add_flag("--yes", *yes, "Without asking; needed where nobody can be asked");
}

void AddTargetOption(CLI::App* app, bool required, Target* target) {
  AddParsedOption(
      app, "--target", "TARGET", target, ParseTarget,
      "What the cameras see: marker positions in metres along the wand, and after ';' diameter "
      "(m), "
      "hz, tolerance (m): \"wand:0,0.13,0.39;diameter=0.04;hz=500\"; \"point\", one marker; "
      "\"rigid:FILE\", a rigid body: a line with label, x, y, z and sigma (m) for each point; "
      "\"board:checker,9x6,0.04\", a printed board (rigcal board show lists the kinds); or "
      "\"static:FILE\", points that do not move: a line with the label of each, or as for rigid")
      ->required(required);
}

void AddCalibrationOptions(CLI::App* app, CalibrationOptions* options) {
  const std::string other_group = app->option_defaults()->get_group();
  app->option_defaults()->group("Calibration");
  AddOption(app, "--reference-camera", "CAMERA", &options->reference_camera,
            "Camera whose frame is the rig frame; without it the one with the lowest name");
  AddEstimateOption(app, "--intrinsics", "Intrinsics of the cameras", &options->intrinsics);
  AddEstimateOption(app, "--time-offsets", "Time offsets of the clocks", &options->time_offsets);
  AddEstimateOption(app, "--marker-positions", "Spacing of the wand's markers",
                    &options->marker_positions);
  AddTrajectoryOption(app, &options->trajectory);
  AddOption(app, "--sigma-px", "PX", &options->sigma_px,
            "One sigma of each marker's centre, pixels; without it as observed")
      ->check(NumberBetween(1e-3, 100));
  app->add_option_function<double>(
         "--association-tolerance-ms",
         [options](double tolerance_ms) { options->association_tolerance_s = tolerance_ms / 1000; },
         "Largest difference in time of two observations of one moment; without it from the "
         "cameras' own periods")
      ->type_name("MS")
      ->check(NumberBetween(1e-6, 1e6));
  app->add_option_function<double>(
         "--accept-mm", [options](double accept_mm) { options->accept_m = accept_mm / 1000; },
         "Largest error that is acceptable, mm: a result with a larger predicted error is graded "
         "bad; without it 1 % of the cameras' median distance from the waved volume")
      ->type_name("MM")
      ->check(NumberBetween(1e-3, 1e6));
  AddParsedOption(
      app, "--distance", "CAMERA,CAMERA,METRES[,SIGMA_M]", &options->known_distance, ParseDistance,
      "Measured distance between the optical centres of two cameras, metres, and its one sigma "
      "(default 0.002): the scale, with --target point");
  AddOption(app, "--seed", "NUMBER", &options->seed, "Seed of every random choice")
      ->check(NumberBetween(0, 4294967295.0));
  app->option_defaults()->group(other_group);
}

void AddListOptions(CLI::App* app, const std::string& example, const std::string& orders,
                    ListOptions* options) {
  AddOption(app, "--rig", "RIG", &options->rig, "Of this rig only");
  AddOption(app, "--filter", "FILTER", &options->filter,
            absl::StrCat("Terms joined by AND, such as ", example, "; see docs/api.md"));
  AddOption(app, "--order-by", "FIELD", &options->order_by,
            absl::StrCat("Sorted by ", orders, "; with \" desc\" for descending"));
}

}  // namespace rigcal::client

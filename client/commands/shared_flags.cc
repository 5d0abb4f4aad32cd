// SPDX-License-Identifier: Apache-2.0
#include <cmath>
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
      ->check(CLI::IsMember({"fixed", "refined", "auto"}).description(""))
      ->group("Calibration");
}

// "A,B,METRES" or "A,B,METRES,SIGMA_M".
KnownDistance ParseDistance(const std::string& text) {
  const std::vector<std::string> parts = absl::StrSplit(text, ',');
  const auto fail = [&text](const std::string& why) {
    throw CLI::ValidationError("--distance " + text, why);
  };
  KnownDistance known;
  if (parts.size() != 3 && parts.size() != 4) {
    fail("wants two cameras and metres between them, like cam0,cam1,1.25 or cam0,cam1,1.25,0.001");
  }
  known.camera_a = parts[0];
  known.camera_b = parts[1];
  if (!absl::SimpleAtod(parts[2], &known.distance_m)) fail("'" + parts[2] + "' is not a number");
  if (parts.size() == 4 && !(absl::SimpleAtod(parts[3], &known.sigma_m) && known.sigma_m > 0)) {
    fail("the sigma '" + parts[3] + "' is not a positive number of metres");
  }
  CalibrationOptions options;
  options.known_distance = known;
  if (const absl::Status status = options.Validate(); !status.ok()) {
    fail(std::string(status.message()));
  }
  return known;
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

void AddTargetOption(CLI::App* app, bool required, Target* target) {
  app->add_option_function<std::string>(
         "--target",
         [target](const std::string& text) {
           absl::StatusOr<Target> parsed = ParseTarget(text);
           if (!parsed.ok()) {
             throw CLI::ValidationError("--target " + text, std::string(parsed.status().message()));
           }
           *target = *std::move(parsed);
         },
         "What is waved: marker positions in metres along the wand, and after ';' diameter (m), "
         "hz, tolerance (m): \"wand:0,0.13,0.39;diameter=0.04;hz=500\"; or \"point\", one marker")
      ->type_name("TARGET")
      ->required(required);
}

void AddCalibrationOptions(CLI::App* app, CalibrationOptions* options) {
  app->add_option("--reference-camera", options->reference_camera,
                  "Camera whose frame is the rig frame; without it the one with the lowest name")
      ->type_name("CAMERA")
      ->group("Calibration");
  AddEstimateOption(app, "--intrinsics", "Intrinsics of the cameras", &options->intrinsics);
  AddEstimateOption(app, "--time-offsets", "Time offsets of the clocks", &options->time_offsets);
  AddEstimateOption(app, "--marker-positions", "Spacing of the wand's markers",
                    &options->marker_positions);
  app->add_option("--sigma-px", options->sigma_px,
                  "One sigma of each marker's centre, pixels; without it as observed")
      ->type_name("PX")
      ->check(NumberBetween(1e-3, 100))
      ->group("Calibration");
  app->add_option_function<double>(
         "--association-tolerance-ms",
         [options](double tolerance_ms) { options->association_tolerance_s = tolerance_ms / 1000; },
         "Largest difference in time of two observations of one moment; without it from the "
         "cameras' own periods")
      ->type_name("MS")
      ->check(NumberBetween(1e-6, 1e6))
      ->group("Calibration");
  app->add_option_function<std::string>(
         "--distance",
         [options](const std::string& text) { options->known_distance = ParseDistance(text); },
         "Measured distance between the optical centres of two cameras, metres, and its one sigma "
         "(default 0.002): the scale, with --target point")
      ->type_name("CAMERA,CAMERA,METRES[,SIGMA_M]")
      ->group("Calibration");
  app->add_option("--seed", options->seed, "Seed of every random choice")
      ->type_name("NUMBER")
      ->check(NumberBetween(0, 4294967295.0))
      ->group("Calibration");
}

void AddListOptions(CLI::App* app, const std::string& example, const std::string& orders,
                    ListOptions* options) {
  app->add_option("--rig", options->rig, "Of this rig only")->type_name("RIG");
  app->add_option("--filter", options->filter,
                  absl::StrCat("Terms joined by AND, such as ", example, "; see docs/api.md"))
      ->type_name("FILTER");
  app->add_option("--order-by", options->order_by,
                  absl::StrCat("Sorted by ", orders, "; with \" desc\" for descending"))
      ->type_name("FIELD");
}

}  // namespace rigcal::client

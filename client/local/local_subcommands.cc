// SPDX-License-Identifier: Apache-2.0
#include <memory>

#include "absl/strings/numbers.h"
#include "client/commands/command_parser.h"
#include "client/local/local_command.h"

namespace rigcal::client {
namespace {

constexpr double kMaxSpeed = 1e6;

CLI::Validator Speed() {
  return CLI::Validator(
      [](std::string& text) -> std::string {
        double factor = 0;
        if (text == "max") return "";
        if (absl::SimpleAtod(text, &factor) && factor > 0 && factor <= kMaxSpeed) return "";
        return "'" + text + "' is neither max nor a factor above 0";
      },
      "");
}

void AddSimulateOption(CLI::App* app, LocalOptions* options) {
  app->add_option_function<std::string>(
         "--simulate",
         [options](const std::string& text) {
           absl::StatusOr<SimulatedRigOptions> parsed = ParseSimulatedRigOptions(text);
           if (!parsed.ok()) {
             throw CLI::ValidationError("--simulate " + text,
                                        std::string(parsed.status().message()));
           }
           options->simulation = *std::move(parsed);
         },
         "A simulated rig instead, compared with ground truth afterwards; \"\" or such as "
         "\"cameras=6;seed=1;duration=60;noise=0.3;outliers=0.02;offset.2=0.008\"; with pixels=1 "
         "its agents find the wand in rendered pictures, with events=2 the last two in the events "
         "of "
         "event cameras: \"cameras=6;rate=50;pixels=1;events=2;lux=300\"")
      ->type_name("OPTIONS");
}

}  // namespace

void AddLocalCommand(CommandParser& parser) {
  const auto options = std::make_shared<LocalOptions>();
  CLI::App* app = parser.AddServerlessCommand(
      "local",
      "Calibrate a recorded or simulated rig on this machine: starts a server and one agent per "
      "camera, captures, calibrates, prints the result and leaves nothing running",
      [options](CommandContext& context) { return RunLocal(*options, context); });
  const auto data = std::make_shared<std::string>();
  const auto keep = std::make_shared<std::string>();
  app->add_option("--data", *data,
                  "Folder with a recording: <camera>.csv (time_ns;x0;y0;x1;y1;..., -1: not seen), "
                  "or events in <camera>.raw, .h5 or .hdf5, and <camera>.yaml (OpenCV intrinsics) "
                  "for each camera")
      ->type_name("DIR");
  app->add_option("--event-options", options->event_options,
                  "With --data: how recordings of events are read, as behind raw:FILE; such as "
                  "\"rate=500;clock=cable\" for sensors on one sync cable")
      ->type_name("OPTIONS");
  AddSimulateOption(app, options.get());
  AddTargetOption(app, /*required=*/false, &options->target);
  app->add_option("--keep", *keep, "Keep the store, the logs and an export in this new folder")
      ->type_name("DIR");
  app->add_option("--speed", options->speed,
                  "As fast as it goes (without it), or at this factor of the recorded pace")
      ->type_name("max|FACTOR")
      ->check(Speed());
  AddCalibrationOptions(app, &options->calibration);
  app->parse_complete_callback([app, options, data, keep] {
    if (app->count("--data") + app->count("--simulate") != 1) {
      throw CLI::ValidationError("rigcal local", "needs either --data DIR or --simulate OPTIONS");
    }
    if (app->count("--data") == 1 && app->count("--target") == 0) {
      throw CLI::RequiredError("--target, such as --target " + std::string(kDefaultTarget));
    }
    if (app->count("--data") == 0 && app->count("--event-options") == 1) {
      throw CLI::ValidationError("--event-options", "is for --data");
    }
    if (app->count("--data") == 1 && data->empty())
      throw CLI::ValidationError("--data", "is empty");
    if (app->count("--keep") == 1 && keep->empty())
      throw CLI::ValidationError("--keep", "is empty");
    if (app->count("--target") == 0) options->target = *ParseTarget(kDefaultTarget);
    options->data = *data;
    options->keep = *keep;
  });
}

}  // namespace rigcal::client

// SPDX-License-Identifier: Apache-2.0
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

}  // namespace

void AddLocalCommand(CommandParser& parser) {
  const auto [app, options] = parser.AddCommand(
      nullptr, "local",
      "Calibrate a recorded or simulated rig on this machine: starts a server and one agent per "
      "camera, captures, calibrates, prints the result and leaves nothing running",
      RunLocal, /*asks_server=*/false);
  AddOption(
      app, "--data", "DIR", &options->data,
      "Folder with a recording: <camera>.csv (time_ns;x0;y0;x1;y1;..., -1: not seen), "
      "events in <camera>.raw, .h5 or .hdf5, images in a folder <camera>, or a video "
      "<camera>.mp4 (.mkv, .avi, ...), and <camera>.yaml (OpenCV intrinsics) for each camera");
  AddOption(app, "--frame-options", "OPTIONS", &options->recording.frames,
            "With --data: how images and videos are read, as behind images:FOLDER; such as "
            "\"fps=25\" where they have no times");
  AddOption(app, "--event-options", "OPTIONS", &options->recording.events,
            "With --data: how recordings of events are read, as behind raw:FILE; such as "
            "\"rate=500;clock=cable\" for sensors on one sync cable");
  AddParsedOption(
      app, "--simulate", "OPTIONS", &options->simulation, ParseSimulatedRigOptions,
      "A simulated rig instead, compared with ground truth afterwards; \"\" or such as "
      "\"cameras=6;seed=1;duration=60;noise=0.3;outliers=0.02;offset.2=0.008\"; with pixels=1 "
      "its agents find the wand in rendered pictures, with events=2 the last two in the events "
      "of event cameras: \"cameras=6;rate=50;pixels=1;events=2;lux=300\"");
  AddOption(app, "--lenses", "DIR", &options->lenses,
            "With --simulate: lenses of the cameras, <camera>.yaml, instead of the right ones; as "
            "rigcal-agent intrinsics makes them");
  AddTargetOption(app, /*required=*/false, &options->target);
  AddOption(app, "--keep", "DIR", &options->keep,
            "Keep the store, the logs and an export in this new folder");
  AddOption(app, "--speed", "max|FACTOR", &options->speed,
            "As fast as it goes (without it), or at this factor of the recorded pace")
      ->check(Speed());
  AddCalibrationOptions(app, &options->calibration);
  app->parse_complete_callback([app = app, options = options] {
    if (app->count("--data") + app->count("--simulate") != 1) {
      throw CLI::ValidationError("rigcal local", "needs either --data DIR or --simulate OPTIONS");
    }
    if (app->count("--data") == 1 && app->count("--target") == 0) {
      throw CLI::RequiredError("--target, such as --target " + std::string(kDefaultTarget));
    }
    for (const char* of_data : {"--event-options", "--frame-options"}) {
      if (app->count("--data") == 0 && app->count(of_data) == 1) {
        throw CLI::ValidationError(of_data, "is for --data");
      }
    }
    if (app->count("--simulate") == 0 && app->count("--lenses") == 1) {
      throw CLI::ValidationError("--lenses", "is for --simulate");
    }
    if (app->count("--data") == 1 && options->data.empty()) {
      throw CLI::ValidationError("--data", "is empty");
    }
    if (app->count("--keep") == 1 && options->keep.empty()) {
      throw CLI::ValidationError("--keep", "is empty");
    }
    if (app->count("--target") == 0) options->target = *ParseTarget(kDefaultTarget);
  });
}

}  // namespace rigcal::client

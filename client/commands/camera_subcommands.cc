// SPDX-License-Identifier: Apache-2.0
#include "client/commands/agent_command.h"
#include "client/commands/camera_choice_command.h"
#include "client/commands/camera_command.h"
#include "client/commands/command_parser.h"

namespace rigcal::client {
namespace {

void AddCamera(CLI::App* app, CameraOptions* options) {
  AddArgument(app, "CAMERA", "Name of the camera", &options->camera);
  AddOption(app, "--rig", "RIG", &options->rig,
            "Rig of the camera, if several have one of that name");
}

void AddDetectorCommands(CommandParser& parser, CLI::App* cameras) {
  auto [show, shown] = parser.AddCommand(
      cameras, "detector", "The colour that its detector looks for, and what it ignores",
      ShowDetector);
  AddCamera(show, shown);

  auto [mask, masked] = parser.AddCommand(
      cameras, "mask",
      "Learn static bright spots to ignore, while a session captures: keep the wand out of view, "
      "or moving",
      LearnCameraMask);
  AddCamera(mask, masked);
  AddOption(mask, "--frames", "COUNT", &masked->frame_count, "Frames to learn from [100]");
  mask->add_flag("--clear", masked->clear, "Forget the learnt mask instead");

  auto [tune, tuned] = parser.AddCommand(
      cameras, "tune",
      "Learn the colour of the wand, while a session captures: show it, near and far", TuneCamera);
  AddCamera(tune, tuned);
  AddOption(tune, "--frames", "COUNT", &tuned->frame_count, "Frames to learn from [50]");

  auto [set, colour] = parser.AddCommand(
      cameras, "colour", "Set the colour of the wand; what is not given stays", SetCameraColour);
  AddCamera(set, colour);
  AddOption(set, "--hue-min", "DEG", &colour->hue_min_deg, "0 to 360: red 0, green 120, blue 240");
  AddOption(set, "--hue-max", "DEG", &colour->hue_max_deg, "Below --hue-min: through 0");
  AddOption(set, "--saturation-min", "SHARE", &colour->saturation_min, "0 to 1");
  AddOption(set, "--value-min", "LEVEL", &colour->value_min, "Grey level, 1 to 255");
  AddOption(set, "--washed-out-min", "LEVEL", &colour->washed_out_min,
            "Brighter pixels count whatever their hue; 256: none");
  set->add_flag("--reset", colour->reset, "Back to the agent's configuration");
}

void AddCameraList(CLI::App* app, CameraListOptions* options) {
  AddOption(app, "--rig", "RIG", &options->rig, "Cameras of this rig only");
  AddOption(app, "--agent", "AGENT", &options->agent_id, "Cameras of this agent only");
  app->add_flag("--json", options->json, "The same as -o json");
  app->add_flag("--all", options->all,
                "Every camera; without it, of more than 16, those that need something");
}

void AddChoiceCommands(CommandParser& parser, CLI::App* cameras) {
  auto [list, listed] =
      parser.AddCommand(cameras, "list", "The same as `rigcal cameras` alone", ListCameras);
  AddCameraList(list, listed);

  auto [use, used] = parser.AddCommand(
      cameras, "use", "Have an agent use a camera that it offers, now and after its restarts",
      UseCamera);
  AddArgument(use, "AGENT/DEVICE", "As `rigcal cameras` lists them; the agent may be left out",
              &used->device);
  AddOption(use, "--name", "NAME", &used->camera, "Name of the camera within the rig")->required();
  AddOption(use, "--calibration", "FILE", &used->calibration_file,
            "OpenCV YAML of its lens; needed to solve, not to capture");

  auto [drop, dropped] = parser.AddCommand(
      cameras, "drop", "No longer use a chosen camera; what it has seen stays", DropCamera);
  AddCamera(drop, dropped);
}

}  // namespace

void AddCameraCommands(CommandParser& parser) {
  auto [cameras, list] = parser.AddCommand(
      nullptr, "camera",
      "Cameras: which there are, which are used, their detectors (list, use, drop, move, detector, "
      "mask, tune, colour)",
      ListCameras);
  cameras->alias("cameras");
  cameras->require_subcommand(0, 1);
  AddCameraList(cameras, list);
  AddChoiceCommands(parser, cameras);
  auto [move, camera] = parser.AddCommand(
      cameras, "move",
      "Give a camera to another agent: it belongs to the first one that announced it, and no other "
      "may deliver it",
      MoveCamera);
  AddArgument(move, "CAMERA", "Name of the camera", &camera->camera);
  AddArgument(move, "AGENT", "Id of the agent that it belongs to from now on", &camera->agent_id);
  AddOption(move, "--rig", "RIG", &camera->rig, "Rig of the camera; without it \"rig\"");
  AddDetectorCommands(parser, cameras);
}

}  // namespace rigcal::client

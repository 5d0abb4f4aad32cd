// SPDX-License-Identifier: Apache-2.0
// sim:
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "agent/capture/source_kinds.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr int kNoIndex = -1;

// What both kinds of simulated cameras take.
struct CameraOfWorld {
  std::string camera;
  int camera_index = kNoIndex;
  double speed = 1;
};

CameraOfWorld TakeCamera(SourceText* text) {
  CameraOfWorld taken;
  SourceOptions& given = text->options;
  if (!given.Has("camera")) given.AddFault("camera", "is missing: there is no camera=INDEX");
  given.Take("camera", "a camera's index (0, 1, ...)", 0, std::numeric_limits<int>::max(),
             &taken.camera_index);
  given.TakeSpeed(&taken.speed);
  taken.camera = text->name.empty() ? absl::StrCat("sim_", taken.camera_index) : text->name;
  return taken;
}

std::string Joined(const std::vector<SourceOption>& options) {
  return absl::StrJoin(options, ";", [](std::string* out, const SourceOption& option) {
    absl::StrAppend(out, option.key, "=", option.value);
  });
}

absl::StatusOr<SourceSpec> ParseObservations(SourceText text) {
  SimulatedSourceOptions options;
  CameraOfWorld camera = TakeCamera(&text);
  const std::vector<SourceOption> world = text.options.TakeRest();
  RIGCAL_RETURN_IF_ERROR(text.options.Finish());
  options.camera = std::move(camera.camera);
  options.camera_index = camera.camera_index;
  options.speed = camera.speed;
  RIGCAL_ASSIGN_OR_RETURN(options.simulation, ParseSimulationOptions(Joined(world)));
  return options;
}

absl::StatusOr<SourceSpec> ParseFrames(SourceText text) {
  SimulatedFrameSourceOptions options;
  FrameSourceSpec spec;
  CameraOfWorld camera = TakeCamera(&text);
  TakeDetectingOptions(&text.options, &spec.detecting);
  std::vector<SourceOption> world;
  std::vector<SourceOption> picture;
  for (const SourceOption& option : text.options.TakeRest()) {
    const bool is_seed = option.key == "seed";
    if (is_seed || !IsFrameRenderOption(option.key)) world.push_back(option);
    if (is_seed || IsFrameRenderOption(option.key)) picture.push_back(option);
  }
  RIGCAL_RETURN_IF_ERROR(text.options.Finish());
  options.camera = std::move(camera.camera);
  options.camera_index = camera.camera_index;
  options.speed = camera.speed;
  RIGCAL_ASSIGN_OR_RETURN(options.simulation, ParseSimulationOptions(Joined(world)));
  RIGCAL_ASSIGN_OR_RETURN(options.rendering, ParseFrameRenderOptions(Joined(picture)));
  spec.frames = std::move(options);
  return spec;
}

// `rate` is the world's; how often the wand is looked for in the events is `output`.
absl::StatusOr<SourceSpec> ParseEvents(SourceText text) {
  SimulatedEventSourceOptions options;
  EventSourceSpec spec;
  CameraOfWorld camera = TakeCamera(&text);
  spec.detector.output.rate_hz = 200;
  text.options.Take("output", "a rate of 10 to 1000 Hz", 10.0, 1000.0,
                    &spec.detector.output.rate_hz);
  text.options.Take("clock", &options.clock_id);
  std::vector<SourceOption> world, scene, sensor;
  for (const SourceOption& option : text.options.TakeRest()) {
    const bool is_seed = option.key == "seed";
    const bool of_sensor = IsEventRenderOption(option.key);
    const bool of_scene = IsFrameRenderOption(option.key);
    if (is_seed || (!of_sensor && !of_scene)) world.push_back(option);
    if (is_seed || of_scene) scene.push_back(option);
    if (is_seed || (of_sensor && !of_scene)) sensor.push_back(option);
  }
  RIGCAL_RETURN_IF_ERROR(text.options.Finish());
  options.camera = std::move(camera.camera);
  options.camera_index = camera.camera_index;
  options.speed = camera.speed;
  RIGCAL_ASSIGN_OR_RETURN(options.simulation, ParseSimulationOptions(Joined(world)));
  RIGCAL_ASSIGN_OR_RETURN(options.scene, ParseFrameRenderOptions(Joined(scene)));
  RIGCAL_ASSIGN_OR_RETURN(options.rendering, ParseEventRenderOptions(Joined(sensor)));
  spec.events = std::move(options);
  return spec;
}

}  // namespace

absl::StatusOr<SourceSpec> ParseSimulatedSource(SourceText text) {
  bool pixels = false;
  bool events = false;
  text.options.Take("pixels", &pixels);
  text.options.Take("events", &events);
  if (events) return ParseEvents(std::move(text));
  return pixels ? ParseFrames(std::move(text)) : ParseObservations(std::move(text));
}

}  // namespace rigcal::agent

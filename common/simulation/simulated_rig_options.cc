// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/simulated_rig_options.h"

#include <vector>

#include "common/options/nearest_name.h"
#include "common/options/option_table.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

constexpr char kExample[] = "example: \"cameras=6;pixels=1;events=2\"";

// Options of event cameras alone, where there are none.
absl::Status RefuseEventOptions(const std::vector<OptionText>& given) {
  SimulatedRigOptions unused;
  OptionTable of_events;
  of_events.Add("output", &unused.output_hz, {0, kNoLimit}, "");
  of_events.Add("event_clock", &unused.event_clock, "", "");
  AddOptions(&unused.sensors, &of_events);
  FaultList faults;
  for (const OptionText& option : given) {
    if (option.key == "seed" || !of_events.Has(option.key)) continue;
    faults.Add("\"", option.key, "=", option.value, "\" is for event cameras, and there are none; ",
               kExample);
  }
  return faults.Result();
}

// Options of rendered cameras, where none is rendered.
absl::Status RefusePixelOptions(const std::vector<OptionText>& given) {
  FrameRenderOptions unused;
  SimulatedRigOptions without;
  OptionTable of_pixels;
  OptionTable of_world;
  AddOptions(&unused, &of_pixels);
  AddOptions(&without.world, &of_world);
  FaultList faults;
  for (const OptionText& option : given) {
    if (of_world.Has(option.key) || !of_pixels.Has(option.key)) continue;
    faults.Add(Shown(option.key), "=", Shown(option.value),
               " needs pixels=1: without it no camera renders frames or events; ", kExample);
  }
  return faults.Result();
}

}  // namespace

absl::StatusOr<SimulatedRigOptions> ParseSimulatedRigOptions(std::string_view text) {
  RIGCAL_ASSIGN_OR_RETURN(std::vector<OptionText> given, SplitOptionList(text));
  SimulatedRigOptions options;
  bool pixels = false;
  OptionTable table;
  table.Add("pixels", &pixels, "cameras yield frames");
  table.Add("events", &options.event_cameras, {0, 100}, "how many of them yield events");
  FaultList faults;
  std::vector<OptionText> rest;
  for (OptionText& option : given) {
    if (option.key == "speed") option.key = "wand_speed";
    if (table.Has(option.key)) {
      table.ReadOne(option, &faults);
    } else {
      rest.push_back(option);
    }
  }
  RIGCAL_RETURN_IF_ERROR(faults.Result());
  AddOptions(&options.world, &table);
  if (pixels) {
    AddOptions(&options.frames.emplace(), &table);
  } else {
    RIGCAL_RETURN_IF_ERROR(RefusePixelOptions(rest));
  }
  if (options.event_cameras == 0) {
    RIGCAL_RETURN_IF_ERROR(RefuseEventOptions(rest));
  } else {
    AddOptions(&options.sensors, &table);
    table.Add("output", &options.output_hz, {10, 1000, "Hz"}, "how often events give the wand");
    table.Add("event_clock", &options.event_clock, "NAME", "shared by all event cameras");
  }
  table.Read(rest, &faults);
  RIGCAL_RETURN_IF_ERROR(faults.Result());
  if (options.event_cameras > 0 &&
      (!pixels || options.event_cameras > options.world.camera_count)) {
    faults.Add("events=", options.event_cameras, " needs pixels=1 and at least as many cameras; ",
               kExample);
  }
  faults.Add(options.world.Validate());
  if (options.frames) faults.Add(options.frames->Validate());
  faults.Add(options.sensors.Validate());
  RIGCAL_RETURN_IF_ERROR(faults.Result());
  return options;
}

}  // namespace rigcal

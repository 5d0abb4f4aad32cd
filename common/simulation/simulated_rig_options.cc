// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/simulated_rig_options.h"

#include <string>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "common/status/status_macros.h"

namespace rigcal {

namespace {

constexpr double kLowestHz = 10, kHighestHz = 1000;

// A part of its own: `events=2`. False: not one of these.
absl::StatusOr<bool> TakeRigPart(const std::string& part, bool* pixels,
                                 SimulatedRigOptions* options) {
  const size_t equals = part.find('=');
  const std::string name = part.substr(0, equals);
  const std::string value = equals == std::string::npos ? "" : part.substr(equals + 1);
  if (part == "pixels=0" || part == "pixels=1") {
    *pixels = part == "pixels=1";
  } else if (name == "events") {
    if (!absl::SimpleAtoi(value, &options->event_cameras) || options->event_cameras < 0) {
      return absl::InvalidArgumentError(
          absl::StrCat("\"", part, "\" is not a number of event cameras"));
    }
  } else if (name == "output") {
    const bool is_number = absl::SimpleAtod(value, &options->output_hz);
    if (!is_number || !(options->output_hz >= kLowestHz && options->output_hz <= kHighestHz)) {
      return absl::InvalidArgumentError(
          absl::StrCat("\"", part, "\" is not a rate of 10 to 1000 Hz"));
    }
  } else if (name == "event_clock") {
    if (value.empty()) {
      return absl::InvalidArgumentError(absl::StrCat("\"", part, "\" does not name a clock"));
    }
    options->event_clock = value;
  } else {
    return false;
  }
  return true;
}

// What only event cameras have.
bool IsOfEvents(std::string_view name) {
  return name == "output" || name == "event_clock" ||
         (IsEventRenderOption(name) && !IsFrameRenderOption(name));
}

}  // namespace

absl::StatusOr<SimulatedRigOptions> ParseSimulatedRigOptions(std::string_view text) {
  SimulatedRigOptions options;
  bool pixels = false;
  std::string of_events;  // some part that is
  std::vector<std::string> parts;
  const std::vector<std::string> given = absl::StrSplit(std::string(text), ';', absl::SkipEmpty());
  for (const std::string& part : given) {
    RIGCAL_ASSIGN_OR_RETURN(const bool taken, TakeRigPart(part, &pixels, &options));
    if (!taken) parts.push_back(part);
    if (IsOfEvents(part.substr(0, part.find('=')))) of_events = part;
  }
  std::vector<std::string> world, pictures, sensors;
  for (const std::string& part : parts) {
    const std::string name = part.substr(0, part.find('='));
    const bool of_pictures = pixels && IsFrameRenderOption(name);
    const bool of_sensors = options.event_cameras > 0 && IsEventRenderOption(name);
    if (of_pictures) pictures.push_back(part);
    if (of_sensors && (!of_pictures || name == "seed")) sensors.push_back(part);
    if (name == "seed" || (!of_pictures && !of_sensors)) world.push_back(part);
  }
  const bool without_events = options.event_cameras == 0 && !of_events.empty();
  if (without_events) {
    return absl::InvalidArgumentError(
        absl::StrCat("\"", of_events, "\" is for event cameras, and there is none; example: ",
                     "\"cameras=6;pixels=1;events=2;", of_events, "\""));
  }
  RIGCAL_ASSIGN_OR_RETURN(options.world, ParseSimulationOptions(absl::StrJoin(world, ";")));
  if (options.event_cameras > 0 &&
      (!pixels || options.event_cameras > options.world.camera_count)) {
    return absl::InvalidArgumentError(
        absl::StrCat("events=", options.event_cameras,
                     " needs pixels=1 and at least as many cameras; example: "
                     "\"cameras=6;pixels=1;events=2\""));
  }
  if (pixels) {
    RIGCAL_ASSIGN_OR_RETURN(options.pictures,
                            ParseFrameRenderOptions(absl::StrJoin(pictures, ";")));
  }
  if (options.event_cameras > 0) {
    RIGCAL_ASSIGN_OR_RETURN(options.sensors, ParseEventRenderOptions(absl::StrJoin(sensors, ";")));
  }
  return options;
}

}  // namespace rigcal

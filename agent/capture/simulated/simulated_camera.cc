// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/simulated/simulated_camera.h"

#include <limits>
#include <map>
#include <mutex>
#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/capture/camera_status.h"
#include "agent/capture/source_kind.h"
#include "common/import/intrinsics_file.h"

namespace rigcal::agent {

absl::StatusOr<std::shared_ptr<const SimulatedWorld>> SharedWorld(const SimulationOptions& options,
                                                                  const Target& target) {
  static std::mutex mutex;
  static auto* const worlds = new std::map<std::string, std::weak_ptr<const SimulatedWorld>>;
  const std::string key = FormatSimulationOptions(options) + "|" + FormatTarget(target);
  const std::lock_guard lock(mutex);
  std::erase_if(*worlds, [](const auto& entry) { return entry.second.expired(); });
  if (const auto found = worlds->find(key); found != worlds->end()) {
    if (auto world = found->second.lock()) return world;
  }
  RIGCAL_ASSIGN_OR_RETURN(SimulatedWorld made, SimulatedWorld::Create(options, target));
  auto world = std::make_shared<const SimulatedWorld>(std::move(made));
  worlds->insert_or_assign(key, world);
  return world;
}

void AddOptions(SimulatedCameraOptions* options, OptionTable* table) {
  constexpr double kAnyIndex = std::numeric_limits<int>::max();
  table->Add("camera", &options->camera_index, {0, kAnyIndex}, "index in the rig, from 0");
  AddSpeed(&options->speed, table);
  table->AddPath("calibration", &options->calibration_path,
                 "an OpenCV YAML instead of the camera's own lens");
  AddOptions(&options->simulation, table);
}

void AddNear(bool* held_before, OptionTable* table) {
  table->Add("near", held_before,
             "a board is held right before this camera, for its lens; before an event camera "
             "circles on a screen that blinks");
}

absl::Status SimulatedCameraOptions::Validate(FaultList faults) const {
  if (camera.empty()) faults.Add("the camera's name is empty");
  faults.Add(simulation.Validate());
  if (camera_index < 0 || camera_index >= simulation.camera_count) {
    faults.Add("camera=", camera_index, ", but the world has cameras 0 to ",
               simulation.camera_count - 1);
  }
  if (!(speed > 0)) faults.Add("speed is ", speed, ", but must be above 0");
  return faults.Result(absl::StrCat("camera ", camera, ": "));
}

absl::StatusOr<CameraDescription> DescribeSimulatedCamera(const SimulatedCameraOptions& options) {
  RIGCAL_ASSIGN_OR_RETURN(const Target any_target, ParseTarget("wand:0,0.13,0.39"));
  RIGCAL_ASSIGN_OR_RETURN(const auto world, SharedWorld(options.simulation, any_target));
  CameraDescription description =
      world->cameras()[static_cast<size_t>(options.camera_index)].description;
  description.camera = options.camera;
  description.clock = {.clock_id = options.camera,
                       .timebase = options.simulation.clock_samples ? "" : "sim"};
  description.source = absl::StrCat("sim:camera=", options.camera_index);
  RIGCAL_RETURN_IF_ERROR(description.Validate());
  return description;
}

absl::Status DescribeLens(const SimulatedCameraOptions& options, CameraDescription* description) {
  if (options.calibration_path.empty()) return absl::OkStatus();
  RIGCAL_ASSIGN_OR_RETURN(
      const IntrinsicsFile file,
      OfCamera(options.camera, ReadIntrinsicsFile(options.calibration_path, options.camera)));
  if (file.image_size_px != description->image_size_px) {
    return absl::InvalidArgumentError(absl::StrCat(
        "camera ", options.camera, ": ", options.calibration_path, " is for images of ",
        file.image_size_px.width, "x", file.image_size_px.height, ", the camera's have ",
        description->image_size_px.width, "x", description->image_size_px.height));
  }
  description->intrinsics = file.intrinsics;
  return absl::OkStatus();
}

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/simulated/shared_world.h"

#include <map>
#include <mutex>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/fault_list.h"
#include "common/status/status_macros.h"

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

absl::Status CheckSimulatedCamera(const std::string& camera, int index, int camera_count,
                                  double speed, std::initializer_list<absl::Status> parts) {
  FaultList faults;
  if (camera.empty()) faults.Add("the camera's name is empty");
  for (const absl::Status& status : parts) {
    faults.Add(status);
  }
  if (index < 0 || index >= camera_count) {
    faults.Add("camera=", index, ", but the world has cameras 0 to ", camera_count - 1);
  }
  if (!(speed > 0)) faults.Add("speed is ", speed, ", but must be above 0");
  return faults.Result(absl::StrCat("camera ", camera, ": "));
}

absl::StatusOr<CameraDescription> DescribeSimulatedCamera(const SimulationOptions& options,
                                                          int index, const std::string& camera) {
  RIGCAL_ASSIGN_OR_RETURN(const Target any_target, ParseTarget("wand:0,0.13,0.39"));
  RIGCAL_ASSIGN_OR_RETURN(const auto world, SharedWorld(options, any_target));
  CameraDescription description = world->cameras()[static_cast<size_t>(index)].description;
  description.camera = camera;
  description.clock = {.clock_id = camera, .timebase = options.clock_samples ? "" : "sim"};
  description.source = absl::StrCat("sim:camera=", index);
  RIGCAL_RETURN_IF_ERROR(description.Validate());
  return description;
}

}  // namespace rigcal::agent

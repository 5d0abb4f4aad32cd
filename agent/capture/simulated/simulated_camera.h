// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <initializer_list>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/camera/camera_description.h"
#include "common/options/option_table.h"
#include "common/simulation/world/simulated_world.h"
#include "common/simulation/world/simulation_options.h"
#include "common/target/target.h"

namespace rigcal::agent {

// One camera of a simulated world, whatever it yields.
struct SimulatedCameraOptions {
  std::string camera;            // name within the rig
  int camera_index = 0;          // of the world's cameras, 0 to camera_count - 1
  SimulationOptions simulation;  // the world; equal options are one world in every process
  double speed = 1;              // multiple of the world's pace, > 0; kMaxSpeed: no waiting

  // With the statuses of a camera's other options. INVALID_ARGUMENT with every fault.
  absl::Status Check(std::initializer_list<absl::Status> parts) const;
};

void AddOptions(SimulatedCameraOptions* options, OptionTable* table);

// The world of these options, as long as anybody holds it. It holds a whole trajectory; several
// cameras of one process look at the same one. Any thread.
absl::StatusOr<std::shared_ptr<const SimulatedWorld>> SharedWorld(const SimulationOptions& options,
                                                                  const Target& target);

// How the camera is described, whatever the target.
absl::StatusOr<CameraDescription> DescribeSimulatedCamera(const SimulatedCameraOptions& options);

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <initializer_list>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/camera/camera_description.h"
#include "common/simulation/world/simulated_world.h"
#include "common/simulation/world/simulation_options.h"
#include "common/target/target.h"

namespace rigcal::agent {

// The world of these options, as long as anybody holds it. It holds a whole trajectory; several
// cameras of one process look at the same one. Any thread.
absl::StatusOr<std::shared_ptr<const SimulatedWorld>> SharedWorld(const SimulationOptions& options,
                                                                  const Target& target);

// What every simulated camera is checked for: its name, its index in a world of `camera_count`, its
// pace, and `parts`, the statuses of its other options. INVALID_ARGUMENT with every fault.
absl::Status CheckSimulatedCamera(const std::string& camera, int index, int camera_count,
                                  double speed, std::initializer_list<absl::Status> parts);

// How the world's camera `index` is described under the name `camera`; the target makes no
// difference.
absl::StatusOr<CameraDescription> DescribeSimulatedCamera(const SimulationOptions& options,
                                                          int index, const std::string& camera);

}  // namespace rigcal::agent

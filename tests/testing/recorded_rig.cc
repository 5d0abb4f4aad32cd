// SPDX-License-Identifier: Apache-2.0
#include "tests/testing/recorded_rig.h"

#include <fstream>
#include <iomanip>
#include <stdexcept>

#include "common/camera/camera_export.h"
#include "common/simulation/world/simulated_world.h"

namespace rigcal::testing {

void WriteRecordedRig(const SimulationOptions& options, const std::filesystem::path& directory) {
  Target target;
  target.marker_positions_m = {0, 0.13, 0.39};
  const absl::StatusOr<SimulatedWorld> world = SimulatedWorld::Create(options, target);
  if (!world.ok()) throw std::runtime_error(world.status().ToString());
  std::filesystem::create_directories(directory);
  for (size_t c = 0; c < world->cameras().size(); ++c) {
    const CameraDescription& camera = world->cameras()[c].description;
    CameraExport yaml;
    yaml.camera = camera.camera;
    yaml.image_size_px = camera.image_size_px;
    yaml.intrinsics = *camera.intrinsics;
    const absl::Status written =
        WriteCameraExport((directory / (camera.camera + ".yaml")).string(), yaml);
    if (!written.ok()) throw std::runtime_error(written.ToString());
    std::ofstream csv(directory / (camera.camera + ".csv"));
    csv << std::setprecision(9);
    for (int frame = 0; frame < world->FrameCount(static_cast<int>(c)); ++frame) {
      const Observation observation = world->Observe(static_cast<int>(c), frame);
      csv << observation.time_ns;
      for (const MarkerObservation& marker : observation.markers) {
        if (marker.visible) {
          csv << ';' << marker.centre_px.x() << ';' << marker.centre_px.y();
        } else {
          csv << ";-1;-1";
        }
      }
      csv << '\n';
    }
  }
}

}  // namespace rigcal::testing

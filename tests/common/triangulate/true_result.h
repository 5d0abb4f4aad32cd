// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "common/calibration/calibration.h"
#include "common/simulation/world/simulated_world.h"
#include "common/triangulate/triangulate_rows.h"

namespace rigcal::testing {

// Four cameras and a wand that is waved for so long.
inline SimulatedWorld WavedWorld(double duration_s) {
  SimulationOptions simulation;
  simulation.camera_count = 4;
  simulation.duration_s = duration_s;
  Target wand;
  wand.marker_positions_m = {0, 0.13, 0.39};
  return *SimulatedWorld::Create(simulation, wand);
}

// The calibration of a simulated rig that has no error. Its rig frame is the world's.
inline CalibrationResult TrueResult(const SimulatedWorld& world) {
  CalibrationResult result;
  result.scale_known = true;
  result.target.given = world.target();
  for (const SimulatedCamera& simulated : world.cameras()) {
    CalibratedCamera camera;
    camera.camera = simulated.description.camera;
    camera.image_size_px = simulated.description.image_size_px;
    camera.cam_from_rig = simulated.cam_from_rig;
    camera.intrinsics = simulated.true_intrinsics;
    camera.time_epoch_s = 1e-9 * static_cast<double>(simulated.clock_origin_ns);
    camera.time_offset_s = simulated.time_offset_s - camera.time_epoch_s;
    camera.time_rate_ppm = simulated.time_rate_ppm;
    camera.line_delay_s = simulated.line_delay_s;
    result.cameras.push_back(std::move(camera));
  }
  return result;
}

// What the cameras saw from one time to another, of their frames.
inline std::vector<CameraRows> RowsOf(const SimulatedWorld& world, double from_s = -1e9,
                                      double to_s = 1e9) {
  std::vector<CameraRows> rows;
  for (int c = 0; c < static_cast<int>(world.cameras().size()); ++c) {
    CameraRows& camera = rows.emplace_back();
    camera.camera = world.cameras()[static_cast<size_t>(c)].description.camera;
    for (int i = 0; i < world.FrameCount(c); ++i) {
      const double time_s = world.FrameRigTime(c, i);
      if (time_s >= from_s && time_s < to_s) camera.rows.push_back(world.Observe(c, i));
    }
  }
  return rows;
}

}  // namespace rigcal::testing

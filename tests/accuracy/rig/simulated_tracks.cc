// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/rig/simulated_tracks.h"

#include <Eigen/Geometry>
#include <utility>

namespace rigcal::accuracy {

std::vector<std::vector<RowGroundTruth>> MakeRowGroundTruth(const SimulatedWorld& world) {
  SimulationOptions unflipped_options = world.options();
  unflipped_options.swap_share = 0;
  const SimulatedWorld unflipped = *SimulatedWorld::Create(unflipped_options, world.target());
  std::vector<std::vector<RowGroundTruth>> truth(world.cameras().size());
  for (int c = 0; c < static_cast<int>(truth.size()); ++c) {
    for (int frame = 0; frame < world.FrameCount(c); ++frame) {
      RowGroundTruth entry;
      const Observation row = world.Observe(c, frame, &entry.is_outlier);
      const Observation original = unflipped.Observe(c, frame);
      for (size_t m = 0; m < row.markers.size(); ++m) {
        entry.flipped |= row.markers[m].centre_px != original.markers[m].centre_px;
      }
      truth[static_cast<size_t>(c)].push_back(std::move(entry));
    }
  }
  return truth;
}

int CameraIndex(const SimulatedWorld& world, const std::string& name) {
  for (size_t c = 0; c < world.cameras().size(); ++c) {
    if (world.cameras()[c].description.camera == name) return static_cast<int>(c);
  }
  return -1;
}

PoseError ErrorOf(const RigidTransform& estimated_cam_from_rig,
                  const RigidTransform& true_cam_from_rig) {
  const Eigen::AngleAxisd turn(estimated_cam_from_rig.rotation *
                               true_cam_from_rig.rotation.conjugate());
  return {turn.angle() * turn.axis(), estimated_cam_from_rig.SourceFromTargetTranslation() -
                                          true_cam_from_rig.SourceFromTargetTranslation()};
}

RigidTransform TruePose(const SimulatedWorld& world, int camera, int reference) {
  return world.cameras()[static_cast<size_t>(camera)].cam_from_rig *
         world.cameras()[static_cast<size_t>(reference)].cam_from_rig.Inverse();
}

}  // namespace rigcal::accuracy

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "common/simulation/world/random_stream.h"
#include "common/simulation/world/simulated_world.h"
#include "common/simulation/world/wand_trajectory.h"

namespace rigcal::accuracy {

// A person who waves around one place for a few seconds, turning the wand all the time, and then
// goes on to the next place: anywhere in the volume, or where told.
class WavingPerson {
 public:
  WavingPerson(const WaveVolume& volume, uint32_t seed);

  // Where to go, best first; none: anywhere. Leaves for the first at once, unless already there.
  // The middle of the wand is the pose's origin here and below.
  void GoTo(std::vector<WandPose> places);
  // Ascending times only.
  WandPose At(double time_s);

 private:
  void ChoosePlace();
  void NextStroke();
  Eigen::Vector3d Within(const Eigen::Vector3d& point_m) const;
  Eigen::Vector3d Gaussian();

  const WaveVolume volume_;
  RandomStream random_;
  std::vector<WandPose> places_;
  WandPose place_;
  double leave_s_ = 0;
  WandPose from_, to_;
  double begin_s_ = 0, end_s_ = 0;
};

}  // namespace rigcal::accuracy

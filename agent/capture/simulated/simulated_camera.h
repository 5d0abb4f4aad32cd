// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/capture/paced_source.h"
#include "common/camera/camera_description.h"
#include "common/options/option_table.h"
#include "common/simulation/world/simulated_world.h"
#include "common/simulation/world/simulation_options.h"
#include "common/status/status_macros.h"
#include "common/target/target.h"
#include "common/time/clock.h"

namespace rigcal::agent {

// One camera of a simulated world, whatever it yields.
struct SimulatedCameraOptions {
  std::string camera;            // name within the rig
  int camera_index = 0;          // of the world's cameras, 0 to camera_count - 1
  SimulationOptions simulation;  // the world; equal options are one world in every process
  double speed = 1;              // multiple of the world's pace, > 0; kMaxSpeed: no waiting
  std::string calibration_path;  // lens to describe the camera with; empty: its own

  // INVALID_ARGUMENT with `faults` of the camera's other options, and every other fault.
  absl::Status Validate(FaultList faults = {}) const;
};

void AddOptions(SimulatedCameraOptions* options, OptionTable* table);

// `near`, of the cameras that show a board.
void AddNear(bool* held_before, OptionTable* table);

// The world of these options, as long as anybody holds it. It holds a whole trajectory; several
// cameras of one process look at the same one. Any thread.
absl::StatusOr<std::shared_ptr<const SimulatedWorld>> SharedWorld(const SimulationOptions& options,
                                                                  const Target& target);

// How the camera is described, whatever the target.
absl::StatusOr<CameraDescription> DescribeSimulatedCamera(const SimulatedCameraOptions& options);

// Puts the lens of the options' file in the place of the camera's own, which is the right one.
// INVALID_ARGUMENT: it is for images of another size.
absl::Status DescribeLens(const SimulatedCameraOptions& options, CameraDescription* description);

// What the sources of a simulated camera share. `Options` are SimulatedCameraOptions.
template <typename Base, typename Options>
class SimulatedSource : public PacedSource<Base, Options> {
 public:
  using PacedSource<Base, Options>::PacedSource;
  std::vector<ClockSample> TakeClockSamples() override { return std::exchange(clock_samples_, {}); }

 protected:
  // INVALID_ARGUMENT: the world cannot show this target.
  absl::Status StartWorld(const Target& target) {
    RIGCAL_ASSIGN_OR_RETURN(world_, SharedWorld(this->options_.simulation, target));
    frame_ = 0;
    clock_epochs_ = {};
    clock_samples_.clear();
    this->pacer_.Start();
    return absl::OkStatus();
  }
  const SimulatedCamera& Camera() const {
    return world_->cameras()[static_cast<size_t>(this->options_.camera_index)];
  }
  void SampleClock(int frame) {
    clock_samples_.push_back(world_->SampleClock(this->options_.camera_index, frame));
  }

  // For sources with frames: whether there is one more, ...
  bool HasFrame() const {
    return world_ != nullptr && frame_ < world_->FrameCount(this->options_.camera_index);
  }
  // ... and the step to the next one when this one is due, with a sample of the clock once a
  // second. False: stopped.
  bool PassFrame(int64_t time_ns) {
    if (!this->pacer_.Wait(time_ns)) return false;
    const int frames_per_sample = std::max(1, static_cast<int>(std::lround(Camera().rate_hz)));
    if (this->options_.simulation.clock_samples && frame_ % frames_per_sample == 0) {
      SampleClock(frame_);
    }
    ++frame_;
    return true;
  }

  std::shared_ptr<const SimulatedWorld> world_;
  int frame_ = 0;  // the next one
  ClockEpochCounter clock_epochs_;
  std::vector<ClockSample> clock_samples_;
};

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/recorded/recorded_frames_options.h"

#include "absl/strings/str_cat.h"
#include "common/status/fault_list.h"

namespace rigcal::agent {

absl::Status RecordedFramesOptions::Validate() const {
  FaultList faults;
  if (camera.empty()) faults.Add("the camera's name is empty");
  if (path.empty()) faults.Add("the path of the pictures is empty");
  faults.CheckRange("fps", fps, 0, 1e6);
  faults.CheckRange("exposure", exposure_s, 0, 10, " s");
  if (!(speed > 0)) faults.Add("speed is ", speed, ", but must be above 0");
  return faults.Result(absl::StrCat("camera ", camera, ": "));
}

}  // namespace rigcal::agent

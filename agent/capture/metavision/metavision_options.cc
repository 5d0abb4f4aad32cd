// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/metavision/metavision_options.h"

#include "absl/strings/str_cat.h"
#include "common/status/fault_list.h"

namespace rigcal::agent {

absl::Status MetavisionSourceOptions::Validate() const {
  FaultList faults;
  if (camera.empty()) faults.Add("the camera's name is empty");
  faults.CheckRange("primary_delay", primary_delay_s, 0.0, 60.0, " s");
  faults.CheckRange("latency", latency_s, -10.0, 10.0, " s");
  if (trigger_channel != -1) faults.CheckRange("trigger_channel", trigger_channel, 0, 31);
  if (shortest_pause.count() < 1 || longest_pause < shortest_pause) {
    faults.Add("the shortest pause must be above 0 and not longer than the longest");
  }
  return faults.Result(absl::StrCat("camera ", camera, ": "));
}

}  // namespace rigcal::agent

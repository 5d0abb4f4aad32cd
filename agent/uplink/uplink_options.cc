// SPDX-License-Identifier: Apache-2.0
#include "agent/uplink/uplink_options.h"

#include <utility>

#include "common/status/fault_list.h"
#include "common/status/validate_name.h"

namespace rigcal::agent {

absl::Status UplinkOptions::Validate() const {
  FaultList faults;
  if (incarnation == 0) faults.Add("incarnation must be at least 1");
  if (stream_epoch == 0) faults.Add("stream_epoch must be at least 1");
  if (max_batch_rows == 0) faults.Add("max_batch_rows must be at least 1");
  if (flush_interval.count() <= 0) faults.Add("flush_interval must be above 0");
  if (ping_interval.count() <= 0) faults.Add("ping_interval must be above 0");
  if (silence_timeout <= ping_interval) {
    faults.Add("silence_timeout must be above ping_interval");
  }
  if (lowest_wait.count() <= 0 || highest_wait < lowest_wait) {
    faults.Add("lowest_wait must be above 0 and at most highest_wait");
  }
  for (const auto& [what, name] : {std::pair("agent_id", agent_id), std::pair("rig", rig)}) {
    faults.Add(ValidateName(what, name));
  }
  faults.Add(previews.Validate());
  return faults.Result("uplink: ");
}

}  // namespace rigcal::agent

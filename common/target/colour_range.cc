// SPDX-License-Identifier: Apache-2.0
#include "common/target/colour_range.h"

#include "common/status/fault_list.h"

namespace rigcal {

absl::Status ColourRange::Validate() const {
  FaultList faults;
  faults.CheckRange("hue_min", hue_min_deg, 0, 360);
  faults.CheckRange("hue_max", hue_max_deg, 0, 360);
  faults.CheckRange("saturation_min", saturation_min, 0, 1);
  faults.CheckRange("value_min", value_min, 1, 255);
  faults.CheckRange("washed_out_min", washed_out_min, 1, 256);
  return faults.Result("colour range: ");
}

}  // namespace rigcal

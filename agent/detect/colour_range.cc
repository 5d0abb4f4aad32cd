// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/colour_range.h"

#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace rigcal::agent {

absl::Status ColourRange::Validate() const {
  std::vector<std::string> faults;
  const auto check = [&faults](const char* name, double value, double low, double high) {
    if (value >= low && value <= high) return;
    faults.push_back(absl::StrCat(name, " is ", value, ", but must be ", low, " to ", high));
  };
  check("hue_min", hue_min_deg, 0, 360);
  check("hue_max", hue_max_deg, 0, 360);
  check("saturation_min", saturation_min, 0, 1);
  check("value_min", value_min, 1, 255);
  check("washed_out_min", washed_out_min, 1, 256);
  if (faults.empty()) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("colour range: ", absl::StrJoin(faults, "; ")));
}

}  // namespace rigcal::agent

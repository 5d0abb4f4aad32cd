// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "absl/status/statusor.h"
#include "common/options/option_table.h"
#include "common/simulation/world/simulation_options.h"
#include "common/status/status_macros.h"

namespace rigcal::testing {

// Reads `cameras=4;seed=2`; every part may be left out.
template <typename Options>
absl::StatusOr<Options> OptionsFrom(std::string_view text) {
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<OptionText> given, SplitOptionList(text));
  return ParseOptions<Options>(given, "");
}

inline absl::StatusOr<SimulationOptions> ParseSimulationOptions(std::string_view text) {
  return OptionsFrom<SimulationOptions>(text);
}

}  // namespace rigcal::testing

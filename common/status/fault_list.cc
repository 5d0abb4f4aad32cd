// SPDX-License-Identifier: Apache-2.0
#include "common/status/fault_list.h"

#include "absl/strings/str_join.h"

namespace rigcal {

absl::Status FaultList::Result(std::string_view context, std::string_view separator) const {
  if (faults_.empty()) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(std::string(context), absl::StrJoin(faults_, std::string(separator))));
}

}  // namespace rigcal

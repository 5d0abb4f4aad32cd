// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace rigcal {

// The faults of an options struct, collected so that its Validate() can name all of them at once.
// Not for several threads.
class FaultList {
 public:
  // The pieces, joined as by absl::StrCat.
  template <typename... Pieces>
  void Add(const Pieces&... pieces) {
    faults_.push_back(absl::StrCat(pieces...));
  }
  // The message of a part's own Validate(), unless that is OK.
  void Add(const absl::Status& status) {
    if (!status.ok()) faults_.emplace_back(status.message());
  }
  // Adds "NAME is VALUE, it must be LOW to HIGH" unless the value lies within [low, high]; NaN does
  // not. `unit` follows the numbers as it stands, such as " s".
  template <typename Number>
  void CheckRange(std::string_view name, Number value, std::type_identity_t<Number> low,
                  std::type_identity_t<Number> high, const char* unit = "") {
    if (value >= low && value <= high) return;
    Add(std::string(name), " is ", value, unit, ", it must be ", low, " to ", high, unit);
  }

  // OK if there is none, else INVALID_ARGUMENT: `context`, then the faults.
  absl::Status Result(std::string_view context = {}, std::string_view separator = "; ") const {
    if (faults_.empty()) return absl::OkStatus();
    return absl::InvalidArgumentError(
        absl::StrCat(std::string(context), absl::StrJoin(faults_, std::string(separator))));
  }

 private:
  std::vector<std::string> faults_;
};

}  // namespace rigcal

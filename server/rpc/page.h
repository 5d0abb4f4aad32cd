// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"

namespace rigcal::server {

inline constexpr uint32_t kDefaultPageSize = 100;
inline constexpr uint32_t kMaxPageSize = 1000;
// A page also ends when its message has grown to this: clients take 4 MiB by default.
inline constexpr size_t kMaxPageBytes = 1u << 20;

inline int PageSize(uint32_t asked) {
  return static_cast<int>(asked == 0 ? kDefaultPageSize : std::min(asked, kMaxPageSize));
}

// What a client is told when listing from `token` on failed.
inline absl::Status PageError(const absl::Status& status, const std::string& token) {
  if (!absl::IsNotFound(status)) return status;
  return absl::InvalidArgumentError(
      absl::StrCat("page_token: '", token, "' is not from this list; begin with an empty one"));
}

}  // namespace rigcal::server

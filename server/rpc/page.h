// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace rigcal::server {

inline constexpr uint32_t kDefaultPageSize = 100;
inline constexpr uint32_t kMaxPageSize = 1000;
// A page also ends when its message has grown to this: clients take 4 MiB by default.
inline constexpr size_t kMaxPageBytes = 1u << 20;

inline int PageSize(uint32_t asked) {
  return static_cast<int>(asked == 0 ? kDefaultPageSize : std::min(asked, kMaxPageSize));
}

}  // namespace rigcal::server

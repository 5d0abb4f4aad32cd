// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace rigcal::server {

// As gzip does; `level` 1 (fast) to 9 (small).
std::string Gzipped(std::string_view text, int level);
// And back. DATA_LOSS: it is damaged, or longer than `max_bytes`.
absl::StatusOr<std::string> Gunzipped(std::string_view bytes, size_t max_bytes);

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace rigcal::server {

// CRC-32 as in zlib.
uint32_t Checksum(std::string_view bytes);

// Columns `body_column` and the one after it of a query's row: bytes and their checksum. DATA_LOSS
// naming `record` ("session s-000001") unless they agree. The bytes live until the next step.
absl::StatusOr<std::string_view> CheckedBody(SQLite::Statement& row, int body_column,
                                             std::string_view record);

}  // namespace rigcal::server

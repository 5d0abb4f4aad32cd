// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string_view>

#include "server/store/sql/sql_database.h"

namespace rigcal::server {

// Adds one to a persisted counter ("session", "calibration") and returns it; never the same twice.
uint32_t NextNumber(SqlDatabase& database, std::string_view counter);

}  // namespace rigcal::server

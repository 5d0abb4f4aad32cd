// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/types/span.h"
#include "server/store/sql/sql_database.h"

namespace rigcal::server {

// A stored batch that was found damaged.
struct DamageNote {
  int64_t batch_id = 0;
  int64_t camera_id = 0;
  uint32_t row_count = 0;
  std::string example;  // what is wrong, with session, camera, stream epoch and seq
};

// Those that are not noted in the database.
std::vector<DamageNote> NewDamage(SqlDatabase& database, absl::Span<const DamageNote> notes);
// Adds them to the counts of their cameras, each batch once. Inside a transaction of the caller's.
void NoteDamage(SqlDatabase& database, absl::Span<const DamageNote> notes);

}  // namespace rigcal::server

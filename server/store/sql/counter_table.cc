// SPDX-License-Identifier: Apache-2.0
#include "server/store/sql/counter_table.h"

namespace rigcal::server {

uint32_t NextNumber(SqlDatabase& database, std::string_view counter) {
  SqlStatement update = Query(database,
                              "INSERT INTO counter(name, value) VALUES(?, 1) "
                              "ON CONFLICT(name) DO UPDATE SET value = counter.value + 1 "
                              "RETURNING value",
                              counter);
  update.Step();
  const uint32_t number = update.Uint32(0);
  while (update.Step()) {
  }
  return number;
}

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#include "server/store/sql/sql_database.h"

#include <limits>

namespace rigcal::server {

uint32_t SqlStatement::Uint32(int column) {
  return static_cast<uint32_t>(
      std::clamp<int64_t>(Int64(column), 0, std::numeric_limits<uint32_t>::max()));
}

uint64_t SqlStatement::Uint64(int column) {
  return static_cast<uint64_t>(std::max<int64_t>(0, Int64(column)));
}

void SqlStatement::Bind(int index, std::optional<uint32_t> number) {
  if (number) {
    driver_->BindNumber(index, *number);
  } else {
    driver_->BindNull(index);
  }
}

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#include "server/store/sqlite/record_checksum.h"

#include <zlib.h>

#include <string>

#include "absl/strings/str_cat.h"
#include "server/store/sqlite/sqlite_connection.h"

namespace rigcal::server {

uint32_t Checksum(std::string_view bytes) {
  return static_cast<uint32_t>(
      crc32_z(crc32_z(0, nullptr, 0), reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

absl::StatusOr<std::string_view> CheckedBody(SQLite::Statement& row, int body_column,
                                             std::string_view record) {
  const std::string_view body = ColumnBytes(row, body_column);
  if (Checksum(body) != ColumnUint32(row, body_column + 1)) {
    return absl::DataLossError(
        absl::StrCat("the record of ", std::string(record), " is damaged: its checksum is wrong"));
  }
  return body;
}

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace rigcal::testing {

// A flat Parquet file, read with nothing but the format's documentation in hand
// (apache/parquet-format: README.md, Encodings.md, parquet.thrift; thrift-compact-protocol.md).
struct ParquetTable {
  using Values = std::variant<std::vector<int32_t>, std::vector<int64_t>, std::vector<double>,
                              std::vector<std::string>>;
  std::vector<std::string> names;
  std::vector<Values> columns;  // in the order of the names
  std::vector<int64_t> group_rows;
  int64_t row_count = 0;
  std::map<std::string, std::string> notes;
};

// Throws std::runtime_error with what is wrong: magic, lengths, types, encodings, counts, offsets.
ParquetTable ReadParquet(std::string_view file);

}  // namespace rigcal::testing

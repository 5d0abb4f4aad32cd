// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace rigcal::client {

// A column of a table; every column of a table has as many values.
struct ParquetColumn {
  std::string name;
  // Strings are UTF-8.
  std::variant<std::vector<int32_t>, std::vector<int64_t>, std::vector<double>,
               std::vector<std::string>>
      values;
};

// A flat table as an Apache Parquet file: the part of the format that every reader has. All columns
// are required, PLAIN encoding, no compression, a data page of version 1 for each column of a row
// group, no statistics and no indexes. Source: the specification in apache/parquet-format
// (README.md, Encodings.md, src/main/thrift/parquet.thrift), the footer by Thrift's compact
// protocol.
//
// `notes`: key and value pairs, which go into the file's metadata. `rows_per_group` bounds what a
// reader has in memory.
std::string ParquetFile(const std::vector<ParquetColumn>& columns,
                        const std::vector<std::pair<std::string, std::string>>& notes,
                        size_t rows_per_group = 65'536);

}  // namespace rigcal::client

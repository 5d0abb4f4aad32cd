// SPDX-License-Identifier: Apache-2.0
#include "client/results/parquet_file.h"

#include <algorithm>
#include <bit>
#include <string_view>

namespace rigcal::client {
namespace {

constexpr std::string_view kMagic = "PAR1";
// Of parquet.thrift.
constexpr int32_t kFormatVersion = 1;
constexpr int32_t kRequired = 0, kUtf8 = 0, kDataPage = 0;
constexpr int32_t kPlain = 0, kRle = 3, kUncompressed = 0;
enum ParquetType : int32_t { kInt32 = 1, kInt64 = 2, kDouble = 5, kByteArray = 6 };

template <typename Integer>
void AppendLittleEndian(Integer value, std::string* bytes) {
  for (size_t i = 0; i < sizeof(value); ++i) {
    bytes->push_back(static_cast<char>(static_cast<uint64_t>(value) >> (8 * i) & 0xff));
  }
}

// Structs by Thrift's compact protocol. Fields are written in ascending order of their ids, which
// are at most 15 apart.
class ThriftWriter {
 public:
  void Int32(int id, int32_t value) {
    Field(id, kTypeInt32);
    ZigZag(value);
  }
  void Int64(int id, int64_t value) {
    Field(id, kTypeInt64);
    ZigZag(value);
  }
  void Text(int id, std::string_view value) {
    Field(id, kTypeBinary);
    Bytes(value);
  }
  void BeginStruct(int id) {
    Field(id, kTypeStruct);
    last_ids_.push_back(0);
  }
  void EndStruct() {
    bytes_.push_back(0);
    last_ids_.pop_back();
  }
  void BeginStructs(int id, size_t count) { List(id, count, kTypeStruct); }
  // One struct of a list.
  void BeginElement() { last_ids_.push_back(0); }
  void Int32s(int id, const std::vector<int32_t>& values) {
    List(id, values.size(), kTypeInt32);
    for (const int32_t value : values) ZigZag(value);
  }
  void Texts(int id, const std::vector<std::string>& values) {
    List(id, values.size(), kTypeBinary);
    for (const std::string& value : values) Bytes(value);
  }
  // Ends the outermost struct.
  std::string Take() && {
    bytes_.push_back(0);
    return std::move(bytes_);
  }

 private:
  enum Type : uint8_t {
    kTypeInt32 = 5,
    kTypeInt64 = 6,
    kTypeBinary = 8,
    kTypeList = 9,
    kTypeStruct = 12
  };
  static constexpr size_t kLongList = 15;

  void Field(int id, Type type) {
    bytes_.push_back(static_cast<char>((id - last_ids_.back()) << 4 | type));
    last_ids_.back() = id;
  }
  void List(int id, size_t count, Type type) {
    Field(id, kTypeList);
    bytes_.push_back(static_cast<char>(std::min(count, kLongList) << 4 | type));
    if (count >= kLongList) Varint(count);
  }
  void Varint(uint64_t value) {
    for (; value >= 0x80; value >>= 7) bytes_.push_back(static_cast<char>(value | 0x80));
    bytes_.push_back(static_cast<char>(value));
  }
  void ZigZag(int64_t value) {
    Varint(static_cast<uint64_t>(value) << 1 ^ static_cast<uint64_t>(value >> 63));
  }
  void Bytes(std::string_view value) {
    Varint(value.size());
    bytes_.append(value);
  }

  std::string bytes_;
  std::vector<int> last_ids_ = {0};
};

ParquetType TypeOf(const ParquetColumn& column) {
  constexpr ParquetType kTypes[] = {kInt32, kInt64, kDouble, kByteArray};
  return kTypes[column.values.index()];
}

size_t SizeOf(const ParquetColumn& column) {
  return std::visit([](const auto& values) { return values.size(); }, column.values);
}

void AppendPlain(int32_t value, std::string* bytes) { AppendLittleEndian(value, bytes); }
void AppendPlain(int64_t value, std::string* bytes) { AppendLittleEndian(value, bytes); }
void AppendPlain(double value, std::string* bytes) {
  AppendLittleEndian(std::bit_cast<uint64_t>(value), bytes);
}
void AppendPlain(const std::string& value, std::string* bytes) {
  AppendLittleEndian(static_cast<uint32_t>(value.size()), bytes);
  bytes->append(value);
}

std::string PlainValues(const ParquetColumn& column, size_t begin, size_t end) {
  std::string bytes;
  std::visit(
      [&](const auto& values) {
        for (size_t i = begin; i < end; ++i) AppendPlain(values[i], &bytes);
      },
      column.values);
  return bytes;
}

std::string PageHeader(size_t byte_count, size_t value_count) {
  ThriftWriter header;
  header.Int32(1, kDataPage);
  header.Int32(2, static_cast<int32_t>(byte_count));
  header.Int32(3, static_cast<int32_t>(byte_count));
  header.BeginStruct(5);
  header.Int32(1, static_cast<int32_t>(value_count));
  header.Int32(2, kPlain);
  header.Int32(3, kRle);
  header.Int32(4, kRle);
  header.EndStruct();
  return std::move(header).Take();
}

struct Chunk {
  size_t offset = 0, byte_count = 0;
};

struct RowGroup {
  size_t row_count = 0;
  std::vector<Chunk> chunks;  // by column
};

void DescribeColumns(const std::vector<ParquetColumn>& columns, ThriftWriter* footer) {
  footer->BeginStructs(2, columns.size() + 1);
  footer->BeginElement();
  footer->Text(4, "schema");
  footer->Int32(5, static_cast<int32_t>(columns.size()));
  footer->EndStruct();
  for (const ParquetColumn& column : columns) {
    footer->BeginElement();
    footer->Int32(1, TypeOf(column));
    footer->Int32(3, kRequired);
    footer->Text(4, column.name);
    if (TypeOf(column) == kByteArray) {
      footer->Int32(6, kUtf8);
      footer->BeginStruct(10);  // the union of logical types
      footer->BeginStruct(1);   // a string, which has no fields
      footer->EndStruct();
      footer->EndStruct();
    }
    footer->EndStruct();
  }
}

void DescribeGroups(const std::vector<ParquetColumn>& columns, const std::vector<RowGroup>& groups,
                    ThriftWriter* footer) {
  footer->BeginStructs(4, groups.size());
  for (const RowGroup& group : groups) {
    size_t byte_count = 0;
    footer->BeginElement();
    footer->BeginStructs(1, columns.size());
    for (size_t c = 0; c < columns.size(); ++c) {
      const Chunk& chunk = group.chunks[c];
      byte_count += chunk.byte_count;
      footer->BeginElement();
      footer->Int64(2, static_cast<int64_t>(chunk.offset));
      footer->BeginStruct(3);
      footer->Int32(1, TypeOf(columns[c]));
      footer->Int32s(2, {kPlain, kRle});
      footer->Texts(3, {columns[c].name});
      footer->Int32(4, kUncompressed);
      footer->Int64(5, static_cast<int64_t>(group.row_count));
      footer->Int64(6, static_cast<int64_t>(chunk.byte_count));
      footer->Int64(7, static_cast<int64_t>(chunk.byte_count));
      footer->Int64(9, static_cast<int64_t>(chunk.offset));
      footer->EndStruct();
      footer->EndStruct();
    }
    footer->Int64(2, static_cast<int64_t>(byte_count));
    footer->Int64(3, static_cast<int64_t>(group.row_count));
    footer->EndStruct();
  }
}

std::string Footer(const std::vector<ParquetColumn>& columns, const std::vector<RowGroup>& groups,
                   size_t row_count,
                   const std::vector<std::pair<std::string, std::string>>& notes) {
  ThriftWriter footer;
  footer.Int32(1, kFormatVersion);
  DescribeColumns(columns, &footer);
  footer.Int64(3, static_cast<int64_t>(row_count));
  DescribeGroups(columns, groups, &footer);
  if (!notes.empty()) {
    footer.BeginStructs(5, notes.size());
    for (const auto& [key, value] : notes) {
      footer.BeginElement();
      footer.Text(1, key);
      footer.Text(2, value);
      footer.EndStruct();
    }
  }
  footer.Text(6, "rigcal");
  return std::move(footer).Take();
}

}  // namespace

std::string ParquetFile(const std::vector<ParquetColumn>& columns,
                        const std::vector<std::pair<std::string, std::string>>& notes,
                        size_t rows_per_group) {
  std::string file(kMagic);
  const size_t row_count = columns.empty() ? 0 : SizeOf(columns.front());
  std::vector<RowGroup> groups;
  for (size_t begin = 0; begin < row_count; begin += rows_per_group) {
    const size_t end = std::min(row_count, begin + rows_per_group);
    RowGroup& group = groups.emplace_back();
    group.row_count = end - begin;
    for (const ParquetColumn& column : columns) {
      const size_t offset = file.size();
      const std::string values = PlainValues(column, begin, end);
      file.append(PageHeader(values.size(), end - begin));
      file.append(values);
      group.chunks.push_back({offset, file.size() - offset});
    }
  }
  const std::string footer = Footer(columns, groups, row_count, notes);
  file.append(footer);
  AppendLittleEndian(static_cast<uint32_t>(footer.size()), &file);
  file.append(kMagic);
  return file;
}

}  // namespace rigcal::client

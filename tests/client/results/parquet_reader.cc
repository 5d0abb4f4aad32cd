// SPDX-License-Identifier: Apache-2.0
#include "tests/client/results/parquet_reader.h"

#include <cstring>
#include <memory>
#include <stdexcept>

namespace rigcal::testing {
namespace {

[[noreturn]] void Complain(const std::string& what) { throw std::runtime_error(what); }

void Check(bool right, const char* what) {
  if (!right) Complain(what);
}

// A value of Thrift: an integer, bytes, a list or a struct.
struct Value {
  int64_t number = 0;
  std::string bytes;
  std::vector<Value> list;
  std::map<int, Value> fields;

  const Value& At(int id) const {
    const auto found = fields.find(id);
    if (found == fields.end()) Complain("field " + std::to_string(id) + " is missing");
    return found->second;
  }
  int64_t Number(int id) const { return At(id).number; }
};

class CompactReader {
 public:
  explicit CompactReader(std::string_view bytes) : rest_(bytes) {}

  Value Struct() {
    Value value;
    int id = 0;
    while (true) {
      const uint8_t head = Byte();
      if (head == 0) return value;
      const int step = head >> 4;
      id = step != 0 ? id + step : static_cast<int>(ZigZag());
      Check(value.fields.try_emplace(id, Of(head & 15)).second, "a field comes twice");
    }
  }
  size_t left() const { return rest_.size(); }

 private:
  uint8_t Byte() {
    Check(!rest_.empty(), "ends within a struct");
    const auto byte = static_cast<uint8_t>(rest_.front());
    rest_.remove_prefix(1);
    return byte;
  }
  uint64_t Varint() {
    uint64_t value = 0;
    for (int shift = 0; shift < 64; shift += 7) {
      const uint8_t byte = Byte();
      value |= uint64_t{byte & 0x7fU} << shift;
      if (byte < 0x80) return value;
    }
    Complain("a varint is too long");
  }
  int64_t ZigZag() {
    const uint64_t value = Varint();
    return static_cast<int64_t>(value >> 1) ^ -static_cast<int64_t>(value & 1);
  }
  Value Of(int type) {
    Value value;
    switch (type) {
      case 1:
      case 2:
        value.number = type == 1;
        break;
      case 4:
      case 5:
      case 6:
        value.number = ZigZag();
        break;
      case 8: {
        const uint64_t size = Varint();
        Check(size <= rest_.size(), "bytes go beyond the end");
        value.bytes = rest_.substr(0, size);
        rest_.remove_prefix(size);
        break;
      }
      case 9: {
        const uint8_t head = Byte();
        const uint64_t size = head >> 4 == 15 ? Varint() : uint64_t{head} >> 4;
        for (uint64_t i = 0; i < size; ++i) value.list.push_back(Of(head & 15));
        break;
      }
      case 12:
        value = Struct();
        break;
      default:
        Complain("type " + std::to_string(type) + " of Thrift is not expected");
    }
    return value;
  }

  std::string_view rest_;
};

uint32_t Length(std::string_view bytes) {
  Check(bytes.size() >= 4, "a length is cut off");
  uint32_t value = 0;
  for (int i = 3; i >= 0; --i) {
    value = value << 8 | static_cast<uint8_t>(bytes[static_cast<size_t>(i)]);
  }
  return value;
}

template <typename Number>
void TakeNumbers(std::string_view* bytes, int64_t count, ParquetTable::Values* values) {
  auto& numbers = std::get<std::vector<Number>>(*values);
  for (int64_t i = 0; i < count; ++i) {
    Check(bytes->size() >= sizeof(Number), "values are cut off");
    Number number;  // this machine is little-endian, as the format
    std::memcpy(&number, bytes->data(), sizeof(number));
    numbers.push_back(number);
    bytes->remove_prefix(sizeof(number));
  }
}

void TakeTexts(std::string_view* bytes, int64_t count, ParquetTable::Values* values) {
  auto& texts = std::get<std::vector<std::string>>(*values);
  for (int64_t i = 0; i < count; ++i) {
    const uint32_t size = Length(*bytes);
    Check(size + 4 <= bytes->size(), "a text is cut off");
    texts.emplace_back(bytes->substr(4, size));
    bytes->remove_prefix(4 + size_t{size});
  }
}

ParquetTable::Values EmptyOf(const Value& element) {
  switch (element.Number(1)) {
    case 1:
      return std::vector<int32_t>();
    case 2:
      return std::vector<int64_t>();
    case 5:
      return std::vector<double>();
    case 6:
      Check(element.Number(6) == 0 && element.At(10).fields.contains(1), "bytes that are no text");
      return std::vector<std::string>();
    default:
      Complain("a type that is not expected");
  }
}

// The one data page of a column in a row group.
void TakePage(std::string_view file, const Value& column, int64_t rows,
              ParquetTable::Values* values) {
  const Value& meta = column.At(3);
  const auto offset = static_cast<size_t>(meta.Number(9));
  const auto size = static_cast<size_t>(meta.Number(7));
  Check(meta.Number(4) == 0 && meta.Number(6) == meta.Number(7), "compressed");
  Check(meta.Number(5) == rows, "a column has another number of values than its group has rows");
  Check(offset >= 4 && offset + size <= file.size(), "a page lies outside of the file");
  CompactReader reader(file.substr(offset, size));
  const Value header = reader.Struct();
  std::string_view bytes = file.substr(offset + size - reader.left(), reader.left());
  Check(header.Number(1) == 0, "no data page");
  Check(header.Number(2) == header.Number(3) &&
            header.Number(3) == static_cast<int64_t>(bytes.size()),
        "a page has another size than it says");
  const Value& data = header.At(5);
  Check(data.Number(1) == rows && data.Number(2) == 0, "a page of other values, or not plain");
  switch (values->index()) {
    case 0:
      TakeNumbers<int32_t>(&bytes, rows, values);
      break;
    case 1:
      TakeNumbers<int64_t>(&bytes, rows, values);
      break;
    case 2:
      TakeNumbers<double>(&bytes, rows, values);
      break;
    default:
      TakeTexts(&bytes, rows, values);
  }
  Check(bytes.empty(), "a page has bytes behind its values");
}

}  // namespace

ParquetTable ReadParquet(std::string_view file) {
  Check(file.size() >= 12 && file.starts_with("PAR1") && file.ends_with("PAR1"), "no magic");
  const size_t footer_size = Length(file.substr(file.size() - 8));
  Check(footer_size + 12 <= file.size(), "the footer is larger than the file");
  CompactReader reader(file.substr(file.size() - 8 - footer_size, footer_size));
  const Value footer = reader.Struct();
  Check(reader.left() == 0, "bytes behind the footer");

  ParquetTable table;
  table.row_count = footer.Number(3);
  const std::vector<Value>& schema = footer.At(2).list;
  Check(!schema.empty() && schema[0].Number(5) == static_cast<int64_t>(schema.size()) - 1,
        "the schema's root has another number of children");
  for (size_t i = 1; i < schema.size(); ++i) {
    Check(schema[i].Number(3) == 0, "a column is not required");
    table.names.push_back(schema[i].At(4).bytes);
    table.columns.push_back(EmptyOf(schema[i]));
  }
  for (const Value& group : footer.At(4).list) {
    const std::vector<Value>& columns = group.At(1).list;
    Check(columns.size() == table.names.size(), "a group has other columns");
    int64_t bytes = 0;
    for (size_t c = 0; c < columns.size(); ++c) {
      const Value& meta = columns[c].At(3);
      Check(meta.At(3).list.size() == 1 && meta.At(3).list[0].bytes == table.names[c],
            "a column has another path");
      Check(meta.Number(1) == schema[c + 1].Number(1), "a column has another type");
      TakePage(file, columns[c], group.Number(3), &table.columns[c]);
      bytes += meta.Number(6);
    }
    Check(bytes == group.Number(2), "a group has another size than its columns");
    table.group_rows.push_back(group.Number(3));
  }
  if (footer.fields.contains(5)) {
    for (const Value& note : footer.At(5).list) table.notes[note.At(1).bytes] = note.At(2).bytes;
  }
  return table;
}

}  // namespace rigcal::testing

// SPDX-License-Identifier: Apache-2.0
#include "common/export/mat_file.h"

#include <algorithm>
#include <cstdint>

#include "common/export/little_endian.h"

namespace rigcal {
namespace {

// Types of data elements and classes of arrays, numbered as in the format's tables.
enum class MatType : uint32_t {
  kInt8 = 1,
  kUint16 = 4,
  kInt32 = 5,
  kUint32 = 6,
  kDouble = 9,
  kMatrix = 14,
};
enum class MatClass : uint32_t { kStruct = 2, kChar = 4, kDouble = 6 };

constexpr size_t kFieldNameLength = 32;

// A data element: its tag, its bytes, zeros up to a multiple of 8. Up to 4 bytes are packed into
// the tag.
std::string Element(MatType type, std::string_view data) {
  std::string bytes;
  if (data.size() <= 4 && type != MatType::kMatrix) {
    AppendLittleEndian(static_cast<uint16_t>(type), &bytes);
    AppendLittleEndian(static_cast<uint16_t>(data.size()), &bytes);
  } else {
    AppendLittleEndian(static_cast<uint32_t>(type), &bytes);
    AppendLittleEndian(static_cast<uint32_t>(data.size()), &bytes);
  }
  bytes += data;
  bytes.resize((bytes.size() + 7) / 8 * 8, '\0');
  return bytes;
}

template <typename Number>
std::string BytesOf(std::span<const Number> values) {
  std::string bytes;
  for (const Number value : values) AppendLittleEndian(value, &bytes);
  return bytes;
}

std::string ArrayElement(MatClass array_class, int32_t rows, int32_t cols, std::string_view name,
                         const std::string& content) {
  const uint32_t flags[] = {static_cast<uint32_t>(array_class), 0};
  const int32_t dimensions[] = {rows, cols};
  return Element(MatType::kMatrix, Element(MatType::kUint32, BytesOf<uint32_t>(flags)) +
                                       Element(MatType::kInt32, BytesOf<int32_t>(dimensions)) +
                                       Element(MatType::kInt8, name) + content);
}

}  // namespace

std::string MatMatrix(std::string_view name, const Eigen::MatrixXd& values) {
  // Columns one after the other, as Eigen has them.
  const std::span<const double> data(values.data(), static_cast<size_t>(values.size()));
  return ArrayElement(MatClass::kDouble, static_cast<int32_t>(values.rows()),
                      static_cast<int32_t>(values.cols()), name,
                      Element(MatType::kDouble, BytesOf<double>(data)));
}

std::string MatRow(std::string_view name, std::span<const double> values) {
  Eigen::MatrixXd row(values.empty() ? 0 : 1, static_cast<Eigen::Index>(values.size()));
  std::copy(values.begin(), values.end(), row.data());
  return MatMatrix(name, row);
}

std::string MatText(std::string_view name, std::string_view ascii) {
  std::string letters;
  for (const char letter : ascii) AppendLittleEndian(static_cast<uint16_t>(letter), &letters);
  return ArrayElement(MatClass::kChar, ascii.empty() ? 0 : 1, static_cast<int32_t>(ascii.size()),
                      name, Element(MatType::kUint16, letters));
}

std::string MatStructs(std::string_view name, std::span<const MatFields> elements) {
  std::string names, values;
  if (!elements.empty()) {
    for (const auto& [field, value] : elements.front()) {
      names += field.substr(0, kFieldNameLength - 1);
      names.resize((names.size() / kFieldNameLength + 1) * kFieldNameLength, '\0');
    }
  }
  for (const MatFields& element : elements) {
    for (const auto& [field, value] : element) values += value;
  }
  const int32_t length[] = {kFieldNameLength};
  return ArrayElement(
      MatClass::kStruct, 1, static_cast<int32_t>(elements.size()), name,
      Element(MatType::kInt32, BytesOf<int32_t>(length)) + Element(MatType::kInt8, names) + values);
}

std::string MatFile(std::string_view description, std::span<const std::string> variables) {
  std::string file(description.substr(0, 116));
  file.resize(124, ' ');
  AppendLittleEndian(uint16_t{0x0100}, &file);
  file += "IM";  // numbers are little-endian
  for (const std::string& variable : variables) file += variable;
  return file;
}

}  // namespace rigcal

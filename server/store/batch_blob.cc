// SPDX-License-Identifier: Apache-2.0
#include "server/store/batch_blob.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <type_traits>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/target/target.h"
#include "server/store/record_checksum.h"

namespace rigcal::server {
namespace {

static_assert(std::endian::native == std::endian::little,
              "columns are copied as they lie in memory");

constexpr char kMagic[4] = {'R', 'G', 'O', 'B'};
constexpr size_t kHeaderSize = 24;
constexpr size_t kChecksumSize = 4;
constexpr uint8_t kPerElement = 0;
constexpr uint8_t kConstant = 1;

template <typename Value>
void Put(Value value, std::string* blob) {
  static_assert(std::is_arithmetic_v<Value>);
  blob->append(reinterpret_cast<const char*>(&value), sizeof(value));
}

// Compared as bytes: two NaN of a refused row must come back as they were.
template <typename Value>
bool AllEqual(const Value* values, size_t count) {
  return count > 0 && std::memcmp(values, values + 1, (count - 1) * sizeof(Value)) == 0;
}

template <typename Value>
void PutColumn(const std::vector<Value>& column, size_t begin, size_t end, std::string* blob) {
  const Value* values = column.data() + begin;
  const bool constant = AllEqual(values, end - begin);
  Put(constant ? kConstant : kPerElement, blob);
  blob->append(reinterpret_cast<const char*>(values), (constant ? 1 : end - begin) * sizeof(Value));
}

// The bytes not read yet; every read checks that there are enough.
class Cursor {
 public:
  explicit Cursor(std::string_view bytes) : bytes_(bytes) {}

  template <typename Value>
  bool Read(Value* value) {
    if (bytes_.size() < sizeof(Value)) return false;
    std::memcpy(value, bytes_.data(), sizeof(Value));
    bytes_.remove_prefix(sizeof(Value));
    return true;
  }
  template <typename Value>
  bool ReadValues(size_t count, std::vector<Value>* values) {
    if (count > bytes_.size() / sizeof(Value)) return false;
    values->resize(count);
    if (count > 0) std::memcpy(values->data(), bytes_.data(), count * sizeof(Value));
    bytes_.remove_prefix(count * sizeof(Value));
    return true;
  }
  template <typename Value>
  bool ReadColumn(size_t count, std::vector<Value>* values) {
    uint8_t encoding = 0;
    if (!Read(&encoding)) return false;
    if (encoding == kPerElement) return ReadValues(count, values);
    Value value{};
    if (encoding != kConstant || !Read(&value)) return false;
    values->assign(count, value);
    return true;
  }
  bool empty() const { return bytes_.empty(); }

 private:
  std::string_view bytes_;
};

// Empty: nothing is wrong.
std::string ParseBody(std::string_view body, uint32_t first_seq, StoredBatch* stored) {
  ObservationBatch& batch = stored->batch;
  char magic[sizeof(kMagic)] = {};
  uint16_t version = 0;
  uint16_t marker_count = 0;
  uint32_t row_count = 0;
  uint32_t refused_count = 0;
  Cursor cursor(body);
  for (char& letter : magic) cursor.Read(&letter);
  if (std::memcmp(magic, kMagic, sizeof(kMagic)) != 0) return "it does not begin with RGOB";
  cursor.Read(&version);
  if (version != kBatchBlobVersion) return absl::StrCat("its format version is ", version);
  cursor.Read(&marker_count);
  cursor.Read(&batch.first_seq);
  cursor.Read(&row_count);
  cursor.Read(&batch.clock_epoch);
  if (!cursor.Read(&refused_count)) return "its header is cut off";
  if (marker_count > kMaxMarkers) return absl::StrCat("it claims ", marker_count, " markers");
  if (row_count > kMaxBatchRows) return absl::StrCat("it claims ", row_count, " rows");
  if (batch.first_seq != first_seq) return absl::StrCat("it holds seq ", batch.first_seq);
  if (refused_count > row_count) return "it has more refused rows than rows";

  batch.marker_count = marker_count;
  const size_t element_count = size_t{row_count} * marker_count;
  // Times come first and are never constant: they prove that a blob of this many rows is as long.
  const bool complete = cursor.ReadValues(row_count, &batch.time_ns) &&
                        cursor.ReadColumn(row_count, &batch.visible_mask) &&
                        cursor.ReadColumn(element_count, &batch.x_px) &&
                        cursor.ReadColumn(element_count, &batch.y_px) &&
                        cursor.ReadColumn(element_count, &batch.cov_xx_px2) &&
                        cursor.ReadColumn(element_count, &batch.cov_xy_px2) &&
                        cursor.ReadColumn(element_count, &batch.cov_yy_px2) &&
                        cursor.ReadColumn(element_count, &batch.time_delta_ns) &&
                        cursor.ReadColumn(element_count, &batch.label_confidence) &&
                        cursor.ReadColumn(element_count, &batch.centre_kind);
  std::vector<uint8_t> refused_bits;
  if (!complete || (refused_count > 0 && !cursor.ReadValues((row_count + 7) / 8, &refused_bits))) {
    return "a column is cut off";
  }
  if (!cursor.empty()) return "it goes on after its last column";
  if (refused_count > 0) {
    stored->refused_rows.resize(row_count);
    for (uint32_t row = 0; row < row_count; ++row) {
      stored->refused_rows[row] = ((refused_bits[row / 8] >> (row % 8)) & 1) != 0;
    }
  }
  return "";
}

}  // namespace

absl::Span<const RefusedRow> RowsWithin(absl::Span<const RefusedRow> refused_rows, size_t begin,
                                        size_t end) {
  const auto before = [](const RefusedRow& refused, size_t row) { return refused.row < row; };
  const auto first = std::lower_bound(refused_rows.begin(), refused_rows.end(), begin, before);
  const auto last = std::lower_bound(first, refused_rows.end(), end, before);
  return refused_rows.subspan(static_cast<size_t>(first - refused_rows.begin()),
                              static_cast<size_t>(last - first));
}

void EncodeBatch(const ObservationBatch& batch, absl::Span<const RefusedRow> refused_rows,
                 size_t begin, size_t end, std::string* blob) {
  const absl::Span<const RefusedRow> refused = RowsWithin(refused_rows, begin, end);
  const size_t rows = end - begin;
  const size_t markers = batch.marker_count;

  blob->clear();
  blob->reserve(kHeaderSize + rows * (13 + markers * 29) + 16);
  blob->append(kMagic, sizeof(kMagic));
  Put(kBatchBlobVersion, blob);
  Put(static_cast<uint16_t>(markers), blob);
  Put(static_cast<uint32_t>(batch.first_seq + begin), blob);
  Put(static_cast<uint32_t>(rows), blob);
  Put(batch.clock_epoch, blob);
  Put(static_cast<uint32_t>(refused.size()), blob);

  blob->append(reinterpret_cast<const char*>(batch.time_ns.data() + begin), rows * sizeof(int64_t));
  PutColumn(batch.visible_mask, begin, end, blob);
  const size_t first = begin * markers;
  const size_t last = end * markers;
  PutColumn(batch.x_px, first, last, blob);
  PutColumn(batch.y_px, first, last, blob);
  PutColumn(batch.cov_xx_px2, first, last, blob);
  PutColumn(batch.cov_xy_px2, first, last, blob);
  PutColumn(batch.cov_yy_px2, first, last, blob);
  PutColumn(batch.time_delta_ns, first, last, blob);
  PutColumn(batch.label_confidence, first, last, blob);
  PutColumn(batch.centre_kind, first, last, blob);
  if (!refused.empty()) {
    const size_t bits_at = blob->size();
    blob->append((rows + 7) / 8, '\0');
    for (const RefusedRow& refused_row : refused) {
      const size_t row = refused_row.row - begin;
      char& bits = (*blob)[bits_at + row / 8];
      bits = static_cast<char>(static_cast<uint8_t>(bits) | (1u << (row % 8)));
    }
  }
  Put(Checksum(*blob), blob);
}

absl::StatusOr<StoredBatch> DecodeBatch(std::string_view blob, const StreamKey& stream,
                                        uint32_t first_seq) {
  StoredBatch stored;
  std::string fault;
  if (blob.size() < kHeaderSize + kChecksumSize) {
    fault = absl::StrCat("it has only ", blob.size(), " bytes");
  } else {
    const std::string_view body = blob.substr(0, blob.size() - kChecksumSize);
    uint32_t expected = 0;
    std::memcpy(&expected, blob.data() + body.size(), sizeof(expected));
    fault =
        Checksum(body) == expected ? ParseBody(body, first_seq, &stored) : "its checksum is wrong";
  }
  if (!fault.empty()) {
    return absl::DataLossError(absl::StrCat(
        "stored observations of session ", stream.session_id, ", camera ", stream.camera,
        ", stream epoch ", stream.stream_epoch, ", from seq ", first_seq, " are damaged: ", fault));
  }
  stored.batch.stream = stream;
  return stored;
}

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
// What the store reads back from its disk: batches, and records of sessions and calibrations. With
// a right checksum put behind them, so that the readers behind the checksum are reached.
//
// The first byte says what follows: bit 0: the checksum is put in order; the rest, modulo 3: a
// batch, a session, a calibration.
#include <zlib.h>

#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "common/wire/calibration_wire.h"
#include "common/wire/session_wire.h"
#include "server/store/batch_blob.h"
#include "tests/fuzz/fuzz_check.h"

namespace {

using ::rigcal::ObservationBatch;
using ::rigcal::server::StoredBatch;

const rigcal::StreamKey kStream{.session_id = "s", .camera = "c", .stream_epoch = 3};

void CheckShapeOf(const StoredBatch& stored) {
  const ObservationBatch& batch = stored.batch;
  const size_t rows = batch.rows();
  FUZZ_CHECK(rows <= rigcal::kMaxBatchRows);
  FUZZ_CHECK(batch.stream == kStream);
  FUZZ_CHECK(batch.visible_mask.size() == rows);
  for (const size_t size :
       {batch.x_px.size(), batch.y_px.size(), batch.cov_xx_px2.size(), batch.cov_xy_px2.size(),
        batch.cov_yy_px2.size(), batch.time_delta_ns.size(), batch.label_confidence.size(),
        batch.centre_kind.size()}) {
    FUZZ_CHECK(size == rows * batch.marker_count);
  }
  FUZZ_CHECK(stored.refused_rows.empty() || stored.refused_rows.size() == rows);
  size_t accepted = 0;
  for (const ObservationBatch& part : rigcal::server::AcceptedRows(stored)) {
    accepted += part.rows();
  }
  FUZZ_CHECK(accepted <= rows);
}

// What can be read is written again with the same meaning.
void CheckBatch(const std::string& blob) {
  uint32_t first_seq = 0;
  if (blob.size() >= 12) std::memcpy(&first_seq, blob.data() + 8, sizeof(first_seq));
  const auto stored = rigcal::server::DecodeBatch(blob, kStream, first_seq);
  if (!stored.ok()) {
    FUZZ_CHECK(stored.status().code() == absl::StatusCode::kDataLoss);
    return;
  }
  CheckShapeOf(*stored);
  std::vector<rigcal::server::RefusedRow> refused;
  for (uint32_t row = 0; row < stored->refused_rows.size(); ++row) {
    if (stored->refused_rows[row]) refused.push_back({.row = row});
  }
  std::string again;
  rigcal::server::EncodeBatch(stored->batch, refused, 0, stored->batch.rows(), &again);
  const auto read = rigcal::server::DecodeBatch(again, kStream, first_seq);
  FUZZ_CHECK(read.ok());
  FUZZ_CHECK(read->batch.rows() == stored->batch.rows());
  FUZZ_CHECK(read->refused_rows.size() == (refused.empty() ? 0 : stored->refused_rows.size()));
  std::string third;
  rigcal::server::EncodeBatch(read->batch, refused, 0, read->batch.rows(), &third);
  FUZZ_CHECK(third == again);
}

template <typename Record>
void CheckRecord(std::string_view bytes, absl::StatusOr<Record> (*parse)(std::string_view bytes),
                 std::string (*serialize)(const Record& record)) {
  const absl::StatusOr<Record> record = parse(bytes);
  if (!record.ok()) return;
  // What was read can be written again.
  FUZZ_CHECK(parse(serialize(*record)).ok());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  const uint8_t kind = data[0];
  std::string bytes(reinterpret_cast<const char*>(data) + 1, size - 1);
  switch ((kind >> 1) % 3) {
    case 0:
      if ((kind & 1) != 0) {
        const auto checksum = static_cast<uint32_t>(crc32_z(
            crc32_z(0, nullptr, 0), reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
        bytes.append(reinterpret_cast<const char*>(&checksum), sizeof(checksum));
      }
      CheckBatch(bytes);
      break;
    case 1:
      CheckRecord(bytes, rigcal::wire::ParseSession, rigcal::wire::SerializeSession);
      break;
    default:
      CheckRecord(bytes, rigcal::wire::ParseCalibration, rigcal::wire::SerializeCalibration);
  }
  return 0;
}

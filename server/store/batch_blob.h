// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "server/store/delivery.h"

namespace rigcal::server {

// The stored form of a range of rows, one value in the database. Clock samples and
// dropped ranges are not in it.
//
//   offset  size  field (all integers and floats little-endian)
//   0       4     "RGOB"
//   4       2     format version, 1
//   6       2     marker_count
//   8       4     first_seq
//   12      4     row_count
//   16      4     clock_epoch
//   20      4     refused_count
//   24      8*n   time_ns per row
//   ...           columns visible_mask, x, y, cov_xx, cov_xy, cov_yy, time_delta, label_confidence,
//                 centre_kind; each is one byte (0: a value per element follows; 1: one value
//                 follows that all elements have) and the values
//   ...           if refused_count > 0: one bit per row, lowest first
//   end-4   4     CRC-32 (as in zlib) of all before
inline constexpr uint16_t kBatchBlobVersion = 1;

// Those of `refused_rows` (sorted by row) that are of rows [begin, end).
absl::Span<const RefusedRow> RowsWithin(absl::Span<const RefusedRow> refused_rows, size_t begin,
                                        size_t end);

// Writes rows [begin, end) of `batch` into `blob`, replacing what is there. `refused_rows` as in
// Delivery, of the whole batch.
void EncodeBatch(const ObservationBatch& batch, absl::Span<const RefusedRow> refused_rows,
                 size_t begin, size_t end, std::string* blob);

// Rows as EncodeBatch wrote them. Trusts nothing in `blob`: whatever is wrong is DATA_LOSS naming
// `stream` and `first_seq`, under which it was stored. `late` is left false.
absl::StatusOr<StoredBatch> DecodeBatch(std::string_view blob, const StreamKey& stream,
                                        uint32_t first_seq);

}  // namespace rigcal::server

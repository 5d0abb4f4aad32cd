// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "common/session/stream_key.h"
#include "common/status/refusal_reason.h"
#include "common/target/observation.h"
#include "common/time/clock.h"

namespace rigcal {

// Sequence numbers are 1 to kMaxSeq, so that one past the last is still a uint32_t.
inline constexpr uint32_t kMaxSeq = 0xfffffffe;
inline constexpr uint32_t kMaxBatchRows = 1u << 20;
inline constexpr uint32_t kMaskMarkers = 32;  // more do not fit a mask

// Observations lost at an agent; their numbers will never come.
struct DroppedRange {
  uint32_t first_seq = 0;
  uint32_t count = 0;
  RefusalReason reason = RefusalReason::kUnspecified;
  friend bool operator==(const DroppedRange&, const DroppedRange&) = default;
};

// Observations of one stream and one clock epoch with consecutive sequence numbers, as columns: row
// i is observation first_seq + i. Columns per marker are row-major (row * marker_count + marker)
// and always have rows * marker_count values; values of invisible markers are 0.
struct ObservationBatch {
  StreamKey stream;
  uint32_t first_seq = 1;
  uint32_t clock_epoch = 0;
  uint32_t marker_count = 0;

  std::vector<int64_t> time_ns;  // per row
  // Per row, bit m = marker m; of more than 32 markers the number of visible ones, which are then
  // those with a kind of centre. Either way 0 says that nothing was seen.
  std::vector<uint32_t> visible_mask;
  std::vector<float> x_px, y_px;
  std::vector<float> cov_xx_px2, cov_xy_px2, cov_yy_px2;
  std::vector<int32_t> time_delta_ns;
  std::vector<float> label_confidence;
  std::vector<uint8_t> centre_kind;  // CentreKind; 0 for invisible markers

  std::vector<ClockSample> clock_samples;
  std::vector<HostAlignment> host_alignments;
  std::vector<DroppedRange> dropped;

  size_t rows() const { return time_ns.size(); }
  bool IsVisible(size_t row, uint32_t marker) const {
    return marker_count > kMaskMarkers ? centre_kind[row * marker_count + marker] != 0
                                       : (visible_mask[row] >> marker & 1u) != 0;
  }
  uint32_t end_seq() const {
    return first_seq + static_cast<uint32_t>(rows());
  }  // one past the last

  // Makes room for so many rows of marker_count markers.
  void Reserve(size_t row_count);
  // Adds a row; `observation.clock_epoch` must be this batch's and its markers `marker_count`.
  void Append(const Observation& observation);
  Observation Row(size_t row) const;
  // Rows [begin, end) with their numbers; samples, alignments and dropped ranges go with `begin ==
  // 0`.
  ObservationBatch Slice(size_t begin, size_t end) const;
};

// The one check of a batch's shape. wire::FromProto calls it for every batch that enters a program;
// all code behind it (ingest, store, client) relies on it and checks values only.
//   - at most kMaxBatchRows rows, and 1 to kMaxMarkers markers where there are rows
//   - every column has one value per row, or per row and marker
//   - a mask has no bits beyond the markers, or is the number of visible ones; each visible marker
//     has a known kind of centre
//   - rows and dropped ranges lie within 1 to kMaxSeq; no dropped range is empty or overlaps the
//     rows; its reason is a known one
// INVALID_ARGUMENT begins with the field: "x_px: ...".
absl::Status CheckShape(const ObservationBatch& batch);

}  // namespace rigcal

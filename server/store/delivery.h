// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/session/observation_batch.h"
#include "common/session/stream_key.h"

namespace rigcal::server {

// A row that ingest refused, and its first fault. The texts are static: a batch full of faults
// costs no allocations. They do not mention the batch, so that the counts of a session do not
// depend on how rows were cut into batches.
struct RefusedRow {
  uint32_t row = 0;             // of the batch, from 0
  uint32_t value = 0;           // index of the faulty value within its column
  std::string_view field = {};  // the column: "x_px"
  RefusalReason reason = RefusalReason::kUnspecified;
  std::string_view detail = {};  // "the x of a marker is not finite"
};

// What arrives for one stream, `batch.stream`: rows, the end of capture, a report, or several of
// them. Passes from the RPC layer through ingest to the store.
struct Delivery {
  // No rows and nothing dropped: this delivery has no observations. Has passed CheckShape.
  ObservationBatch batch;
  // Found by ingest, by row. These rows keep their values and count towards durable_seq.
  std::vector<RefusedRow> refused_rows = {};
  std::optional<uint32_t> last_seq = {};  // the capture has ended with this observation
  // The stream is noted, with nothing of it yet: its agent was told to capture, or has it in its
  // spool. Its camera has not ended before this stream has.
  bool opens_stream = false;
  std::optional<CameraReport> report = {};

  const StreamKey& stream() const { return batch.stream; }
  size_t Bytes() const;  // memory it holds, for bounding queues
};

// The result of one delivery, once the transaction is durable.
struct AppendOutcome {
  uint32_t durable_seq = 0;     // everything up to here is on disk
  uint32_t stored_rows = 0;     // new in this delivery, refused ones not counted
  uint32_t duplicate_rows = 0;  // were stored before, with the same values
  uint32_t conflict_rows = 0;   // others were stored before under their numbers, and stay
  uint32_t refused_rows = 0;    // newly refused
  bool late = false;            // the session had finished: stored as not used
  bool complete = false;        // the stream has ended and everything of it is durable
  bool unknown = false;         // no such session or camera: nothing was stored
};

// A row range of one stream as it is stored. Clock samples and alignments come once each, with the
// first rows of their clock epoch (or with no rows, where that epoch has none). Dropped ranges are
// in the counts only.
struct StoredBatch {
  ObservationBatch batch;          // refused rows included
  std::vector<bool> refused_rows;  // one per row; empty: none is refused
  bool late = false;
  // A record that cannot be read any more: how many rows it had, and what is wrong. `batch` has
  // its stream and its first number then, and no rows.
  uint32_t damaged_rows = 0;
  std::string damage = {};
};

// The rows of a stored batch that were not refused, as one batch for each run of consecutive
// numbers. Clock samples and alignments are kept, with the first of them; a batch of none but
// refused rows with such samples gives one without rows. A damaged one gives none.
std::vector<ObservationBatch> AcceptedRows(StoredBatch stored);

}  // namespace rigcal::server

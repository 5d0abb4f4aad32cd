// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "agent/spool/disk/file_system.h"
#include "agent/spool/observation_spool.h"

namespace rigcal::agent {

// Numbers [first, end) of a stream that were lost in the spool.
struct SpoolGap {
  uint32_t first = 1;
  uint32_t end = 1;
  RefusalReason reason = RefusalReason::kUnspecified;

  friend bool operator==(const SpoolGap&, const SpoolGap&) = default;
};

// A file with consecutive observations of one stream.
struct Segment {
  uint64_t ordinal = 0;  // in order of creation over all streams
  uint32_t first_seq = 1;
  uint32_t end_seq = 1;  // one past its last observation
  uint64_t bytes = 0;
  std::string path;
  std::shared_ptr<SpoolFile> file;  // of a segment being written; else none
};

inline constexpr size_t kRowsAhead = 256;

// One stream of the disk spool: what is known of it in memory. Its rows are in its segments, and at
// most kRowsAhead of them here.
// Not thread-safe.
struct DiskStream : SpooledStream {
  uint32_t number = 0;  // within the spool
  uint32_t marker_count = 0;
  uint32_t begin_seq = 1;  // the first number
  uint64_t boot = 0;
  std::deque<Segment> segments;  // by first_seq
  std::vector<SpoolGap> gaps;    // above durable_seq, ascending, none overlaps another

  // Where the next read probably begins.
  struct Cursor {
    uint64_t ordinal = 0;  // 0: nowhere
    uint32_t next_seq = 0;
    uint64_t offset = 0;
  };
  Cursor cursor;
  std::shared_ptr<SpoolFile> cursor_file;
  // Rows read ahead, at most kRowsAhead: a batch of a few rows would cost a read of the file each.
  // None of them has clock samples.
  ObservationBatch ahead;

  // Marks [first, past) as lost, as far as they are not acknowledged or marked already; returns how
  // many are newly so.
  uint64_t AddGap(uint32_t first, uint32_t past, RefusalReason reason);
  void SetDurable(uint32_t durable_seq);
  // After durable_seq, end_seq or gaps have changed.
  void CountRows();
  // The gap that holds `seq`; null: none.
  const SpoolGap* GapAt(uint32_t seq) const;
};

// ObservationSpool::Read of one stream; `marker_count` and key are filled in. Damaged records that
// it meets become gaps of the stream; their number is added to `*newly_lost`.
ObservationBatch ReadStream(FileSystem& files, DiskStream& stream, uint32_t from_seq,
                            size_t max_rows, uint64_t* newly_lost);

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "absl/container/btree_map.h"
#include "absl/container/inlined_vector.h"

namespace rigcal::server {

// Sequence numbers [first, end).
struct SeqRange {
  uint32_t first = 1;
  uint32_t end = 1;

  uint32_t size() const { return end - first; }
  friend bool operator==(const SeqRange&, const SeqRange&) = default;
};

// The stored sequence numbers of one stream: all up to durable_seq, and ranges above it that
// arrived early. Pure logic; not thread-safe.
class StreamLedger {
 public:
  // `durable_seq`: everything from 1 to it is stored.
  explicit StreamLedger(uint32_t durable_seq = 0) : durable_seq_(durable_seq) {}

  uint32_t durable_seq() const { return durable_seq_; }
  // Ranges stored above durable_seq.
  size_t early_range_count() const { return early_.size(); }

  // The parts of `range` that are not stored, ascending. Empty when all of it is.
  absl::InlinedVector<SeqRange, 2> Missing(SeqRange range) const;
  // Marks `range` as stored; it may overlap what is.
  void Add(SeqRange range);

 private:
  uint32_t durable_seq_ = 0;
  // first -> end; disjoint, not touching one another, all of them beyond durable_seq_ + 1.
  absl::btree_map<uint32_t, uint32_t> early_;
};

}  // namespace rigcal::server

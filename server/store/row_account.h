// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "common/session/stream_audit.h"
#include "server/store/delivery.h"

namespace rigcal::server {

// Counts the rows of one stream as they are read, for Store::AuditStreams. For one thread.
class RowAccount {
 public:
  // `audit`: everything but its rows. Batches that begin behind `last_first_seq` came while the
  // others were read, and do not count.
  RowAccount(StreamAudit audit, const std::vector<StreamAudit::Range>& dropped,
             uint32_t last_first_seq);

  // Of this stream, in any order.
  void Add(const StoredBatch& stored);
  // With its counts and ranges.
  StreamAudit Close() &&;

  // From `first` up to the number before `end`.
  struct Interval {
    uint64_t first = 0;
    uint64_t end = 0;
  };

 private:
  StreamAudit audit_;
  const uint32_t last_first_seq_;
  std::vector<Interval> readable_, damaged_, dropped_;
};

}  // namespace rigcal::server

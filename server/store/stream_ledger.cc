// SPDX-License-Identifier: Apache-2.0
#include "server/store/stream_ledger.h"

#include <algorithm>
#include <iterator>

namespace rigcal::server {

absl::InlinedVector<SeqRange, 2> StreamLedger::Missing(SeqRange range) const {
  absl::InlinedVector<SeqRange, 2> missing;
  uint32_t cursor = std::max(range.first, durable_seq_ + 1);
  auto next = early_.upper_bound(cursor);
  if (next != early_.begin()) cursor = std::max(cursor, std::prev(next)->second);
  while (cursor < range.end) {
    const uint32_t gap_end = next == early_.end() ? range.end : std::min(range.end, next->first);
    missing.push_back({cursor, gap_end});
    if (gap_end == range.end) break;
    cursor = next->second;
    ++next;
  }
  return missing;
}

void StreamLedger::Add(SeqRange range) {
  range.first = std::max(range.first, durable_seq_ + 1);
  if (range.first >= range.end) return;
  auto it = early_.upper_bound(range.first);
  if (it != early_.begin() && std::prev(it)->second >= range.first) --it;
  while (it != early_.end() && it->first <= range.end) {
    range.first = std::min(range.first, it->first);
    range.end = std::max(range.end, it->second);
    it = early_.erase(it);
  }
  if (range.first == durable_seq_ + 1) {
    durable_seq_ = range.end - 1;
  } else {
    early_.emplace(range.first, range.end);
  }
}

}  // namespace rigcal::server

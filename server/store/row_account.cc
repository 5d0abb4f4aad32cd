// SPDX-License-Identifier: Apache-2.0
#include "server/store/row_account.h"

#include <algorithm>
#include <utility>

namespace rigcal::server {
namespace {

using Intervals = std::vector<RowAccount::Interval>;

// Rows are read in their order, so that a whole stream is one interval.
void Join(uint64_t first, uint64_t end, Intervals* intervals) {
  if (!intervals->empty() && intervals->back().end == first) {
    intervals->back().end = end;
  } else {
    intervals->push_back({first, end});
  }
}

// In order, and none touches another.
Intervals Union(Intervals intervals) {
  std::ranges::sort(intervals, {}, &RowAccount::Interval::first);
  Intervals joined;
  for (const auto& interval : intervals) {
    if (joined.empty() || joined.back().end < interval.first) {
      joined.push_back(interval);
    } else {
      joined.back().end = std::max(joined.back().end, interval.end);
    }
  }
  return joined;
}

// Both as Union returns them.
Intervals Without(const Intervals& intervals, const Intervals& others) {
  Intervals left;
  size_t passed = 0;
  for (auto [first, end] : intervals) {
    while (passed < others.size() && others[passed].end <= first) ++passed;
    for (size_t o = passed; o < others.size() && others[o].first < end; ++o) {
      if (others[o].first > first) left.push_back({first, others[o].first});
      first = std::max(first, others[o].end);
    }
    if (first < end) left.push_back({first, end});
  }
  return left;
}

uint64_t CountOf(const Intervals& intervals) {
  uint64_t count = 0;
  for (const auto& [first, end] : intervals) count += end - first;
  return count;
}

std::vector<StreamAudit::Range> FirstRanges(const Intervals& intervals) {
  std::vector<StreamAudit::Range> ranges;
  for (const auto& [first, end] : intervals) {
    if (ranges.size() == StreamAudit::kMaxRanges) break;
    ranges.push_back({static_cast<uint32_t>(first), static_cast<uint32_t>(end - first)});
  }
  return ranges;
}

}  // namespace

RowAccount::RowAccount(StreamAudit audit, const std::vector<StreamAudit::Range>& dropped,
                       uint32_t last_first_seq)
    : audit_(std::move(audit)), last_first_seq_(last_first_seq) {
  for (const StreamAudit::Range& range : dropped) {
    dropped_.push_back({range.first_seq, uint64_t{range.first_seq} + range.count});
  }
}

void RowAccount::Add(const StoredBatch& stored) {
  const bool is_damaged = stored.damaged_rows > 0;
  const uint64_t rows = is_damaged ? stored.damaged_rows : stored.batch.rows();
  const uint64_t first = stored.batch.first_seq;
  if (rows == 0 || first > last_first_seq_) return;
  Join(first, first + rows, is_damaged ? &damaged_ : &readable_);
  if (is_damaged) {
    if (audit_.damage.empty()) audit_.damage = stored.damage;
    return;
  }
  audit_.stored_count += rows;
  if (stored.late) audit_.late_count += rows;
}

StreamAudit RowAccount::Close() && {
  Intervals known = Union(std::move(readable_));
  // How long a damaged record was is what its neighbours leave.
  const Intervals damaged = Without(Union(std::move(damaged_)), known);
  audit_.damaged_count = CountOf(damaged);
  audit_.damaged = FirstRanges(damaged);
  known.insert(known.end(), damaged.begin(), damaged.end());
  known.insert(known.end(), dropped_.begin(), dropped_.end());
  known = Union(std::move(known));
  audit_.highest_seq = audit_.durable_seq;
  if (!known.empty()) {
    audit_.highest_seq = std::max(audit_.highest_seq, static_cast<uint32_t>(known.back().end - 1));
  }
  const Intervals absent = Without({{1, uint64_t{audit_.highest_seq} + 1}}, known);
  audit_.absent_count = CountOf(absent);
  audit_.absent = FirstRanges(absent);
  return std::move(audit_);
}

}  // namespace rigcal::server

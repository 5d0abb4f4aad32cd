// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/events/event_readout.h"

#include <algorithm>
#include <bit>

namespace rigcal {
namespace {

constexpr size_t kBuckets = 4096;
// Up to so many are put in order one by one.
constexpr size_t kFew = 16;

// A complete order: the result must not depend on the order in which pixels were worked out.
bool Before(const PixelRequest& a, const PixelRequest& b) {
  if (a.time_us != b.time_us) return a.time_us < b.time_us;
  if (a.y != b.y) return a.y < b.y;
  return a.x != b.x ? a.x < b.x : b.on < a.on;
}

void SortFew(PixelRequest* begin, PixelRequest* end) {
  for (PixelRequest* next = begin + 1; next < end; ++next) {
    const PixelRequest one = *next;
    PixelRequest* place = next;
    for (; place > begin && Before(one, place[-1]); --place) *place = place[-1];
    *place = one;
  }
}

}  // namespace

EventReadout::EventReadout(uint32_t height, double row_us, double event_us)
    : row_us_(row_us), event_us_(event_us), rows_(height), row_waits_((height + 63) / 64) {}

// Into buckets of equal time first: what a cell asks is spread over it.
void EventReadout::SortByTime(std::vector<PixelRequest>* requests) {
  if (requests->size() < kBuckets / 8) {
    std::sort(requests->begin(), requests->end(), Before);
    return;
  }
  double first_us = requests->front().time_us, last_us = first_us;
  for (const PixelRequest& request : *requests) {
    first_us = std::min(first_us, request.time_us);
    last_us = std::max(last_us, request.time_us);
  }
  const double per_us = (kBuckets - 1) / std::max(1e-6, last_us - first_us);
  const auto bucket = [first_us, per_us](const PixelRequest& request) {
    return static_cast<size_t>((request.time_us - first_us) * per_us);
  };
  bucket_ends_.assign(kBuckets + 1, 0);
  for (const PixelRequest& request : *requests) ++bucket_ends_[bucket(request) + 1];
  for (size_t i = 1; i <= kBuckets; ++i) bucket_ends_[i] += bucket_ends_[i - 1];
  sorted_.resize(requests->size());
  for (const PixelRequest& request : *requests) sorted_[bucket_ends_[bucket(request)]++] = request;
  // Each beginning has become its bucket's end.
  PixelRequest* begin = sorted_.data();
  for (size_t i = 0; i < kBuckets; ++i) {
    PixelRequest* const end = sorted_.data() + bucket_ends_[i];
    if (end - begin > static_cast<std::ptrdiff_t>(kFew)) {
      std::sort(begin, end, Before);
    } else if (end - begin > 1) {
      SortFew(begin, end);
    }
    begin = end;
  }
  requests->swap(sorted_);
}

void EventReadout::Enter(const PixelRequest& request) {
  if (waiting_ >= kMaxWaiting) {
    ++lost_;
    return;
  }
  rows_[request.y].push_back(2u * request.x + (request.on ? 0 : 1));
  row_waits_[request.y / 64] |= uint64_t{1} << (request.y % 64);
  ++waiting_;
}

void EventReadout::ReadRow(std::vector<SimulatedEvent>* events) {
  size_t word = next_row_ / 64;
  uint64_t bits = row_waits_[word] & (~uint64_t{0} << (next_row_ % 64));
  while (bits == 0) {
    word = word + 1 < row_waits_.size() ? word + 1 : 0;
    bits = row_waits_[word];
  }
  const auto y = static_cast<uint32_t>(word * 64) + static_cast<uint32_t>(std::countr_zero(bits));
  std::vector<uint32_t>& row = rows_[y];
  if (row.size() > 1) std::sort(row.begin(), row.end());
  const auto time_us = static_cast<int64_t>(free_at_us_);
  for (const uint32_t one : row) {
    events->push_back(
        {time_us, static_cast<uint16_t>(one / 2), static_cast<uint16_t>(y), one % 2 == 0});
  }
  free_at_us_ += row_us_ + event_us_ * static_cast<double>(row.size());
  waiting_ -= row.size();
  row.clear();
  row_waits_[word] &= ~(uint64_t{1} << (y % 64));
  next_row_ = y + 1 < rows_.size() ? y + 1 : 0;
}

void EventReadout::Read(std::vector<PixelRequest>* requests, double end_us,
                        std::vector<SimulatedEvent>* events) {
  SortByTime(requests);
  size_t next = 0;
  while (true) {
    if (waiting_ == 0) {
      if (next == requests->size()) break;
      const PixelRequest& one = (*requests)[next];
      free_at_us_ = std::max(free_at_us_, one.time_us);
      if (free_at_us_ >= end_us) break;
      if (next + 1 == requests->size() || (*requests)[next + 1].time_us > free_at_us_) {
        // Nothing to arbitrate.
        events->push_back({static_cast<int64_t>(free_at_us_), one.x, one.y, one.on});
        free_at_us_ += row_us_ + event_us_;
        next_row_ = one.y + 1u < rows_.size() ? one.y + 1u : 0;
        ++next;
        continue;
      }
    }
    if (free_at_us_ >= end_us) break;
    while (next < requests->size() && (*requests)[next].time_us <= free_at_us_) {
      Enter((*requests)[next++]);
    }
    if (waiting_ > 0) ReadRow(events);
  }
  while (next < requests->size()) Enter((*requests)[next++]);
  requests->clear();
}

}  // namespace rigcal

// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/event_readout.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace rigcal {

EventReadout::EventReadout(uint32_t height, double row_us, double event_us)
    : row_us_(row_us), event_us_(event_us), rows_(height), row_waits_((height + 63) / 64) {}

void EventReadout::Enter(const PixelRequest& request) {
  if (waiting_ >= kMaxWaiting) {
    ++lost_;
    return;
  }
  rows_[request.y].push_back({request.x, request.on});
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
  std::vector<Waiting>& row = rows_[y];
  std::sort(row.begin(), row.end(), [](const Waiting& a, const Waiting& b) {
    return a.x != b.x ? a.x < b.x : b.on < a.on;
  });
  const auto time_us = static_cast<int64_t>(std::floor(free_at_us_));
  for (const Waiting& one : row) {
    events->push_back({time_us, one.x, static_cast<uint16_t>(y), one.on});
  }
  free_at_us_ += row_us_ + event_us_ * static_cast<double>(row.size());
  waiting_ -= row.size();
  row.clear();
  row_waits_[word] &= ~(uint64_t{1} << (y % 64));
  next_row_ = y + 1 < rows_.size() ? y + 1 : 0;
}

void EventReadout::Read(std::vector<PixelRequest>* requests, double end_us,
                        std::vector<SimulatedEvent>* events) {
  // A complete order: the result must not depend on the order in which pixels were worked out.
  std::sort(requests->begin(), requests->end(), [](const PixelRequest& a, const PixelRequest& b) {
    if (a.time_us != b.time_us) return a.time_us < b.time_us;
    if (a.y != b.y) return a.y < b.y;
    return a.x != b.x ? a.x < b.x : b.on < a.on;
  });
  size_t next = 0;
  while (true) {
    if (waiting_ == 0) {
      if (next == requests->size()) break;
      free_at_us_ = std::max(free_at_us_, (*requests)[next].time_us);
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

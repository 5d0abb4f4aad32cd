// SPDX-License-Identifier: Apache-2.0
#include "agent/event_files/plain_event_reader.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {

bool ToMicroseconds(int64_t time, TimeUnit unit, int64_t* time_us) {
  if (unit == TimeUnit::kSeconds) {
    return !__builtin_mul_overflow(time, int64_t{1'000'000}, time_us);
  }
  if (unit == TimeUnit::kMilliseconds) {
    return !__builtin_mul_overflow(time, int64_t{1000}, time_us);
  }
  *time_us = unit == TimeUnit::kNanoseconds ? time / 1000 - (time % 1000 < 0 ? 1 : 0) : time;
  return true;
}

bool ToMicroseconds(double time, TimeUnit unit, int64_t* time_us) {
  constexpr double kMaxUs = 4e18;  // 64 bits, with room for differences
  const double scaled = time * MicrosecondsOf(unit);
  if (!(std::abs(scaled) < kMaxUs)) return false;
  *time_us = std::llround(scaled);
  return true;
}

absl::StatusOr<std::span<const uint8_t>> PlainEventReader::Next(size_t max_bytes) {
  constexpr size_t kBlockEvents = size_t{1} << 16;
  if (next_ == block_.size()) {
    block_first_ += block_.size();
    next_ = 0;
    RIGCAL_RETURN_IF_ERROR(Read(kBlockEvents, &block_));
  }
  const size_t count = std::min(block_.size() - next_, max_bytes / sizeof(PlainEvent));
  const std::span<const PlainEvent> piece = std::span(block_).subspan(next_, count);
  next_ += count;
  return std::span(reinterpret_cast<const uint8_t*>(piece.data()), piece.size_bytes());
}

std::string PlainEventReader::PlaceOf(uint64_t byte_offset) const {
  const uint64_t event = byte_offset / sizeof(PlainEvent);
  if (event >= block_first_ && event - block_first_ < block_.size()) {
    return PlaceInBlock(static_cast<size_t>(event - block_first_));
  }
  return absl::StrCat("event ", event);
}

}  // namespace rigcal::agent

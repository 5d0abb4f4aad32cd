// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "agent/event/plain_events.h"
#include "agent/event_files/event_file.h"

namespace rigcal::agent {

// A time in microseconds, to the nearest one or, of whole nanoseconds, the one before. False: it
// does not fit.
bool ToMicroseconds(int64_t time, TimeUnit unit, int64_t* time_us);
bool ToMicroseconds(double time, TimeUnit unit, int64_t* time_us);

// A column or row as PlainEvent has it.
inline uint16_t PlainPixel(int64_t value) {
  return value < 0 || value > 0xffff ? uint16_t{0xffff} : static_cast<uint16_t>(value);
}

// Reads the events of a file for interchange in order, a block at a time: as they are, or as a
// stream of EventFormat::kPlain. One thread at a time.
class PlainEventReader : public EventFile {
 public:
  // Replaces `events` by the next ones, at most `max_count`; none: the end. DATA_LOSS: reading
  // failed; names the file and the place.
  virtual absl::Status Read(size_t max_count, std::vector<PlainEvent>* events) = 0;
  // Of event `index` of the last block read: "line 17", "row 3 of /CD/events" (from 0).
  virtual std::string PlaceInBlock(size_t index) const = 0;

  uint64_t byte_offset() const override { return (block_first_ + next_) * sizeof(PlainEvent); }
  absl::StatusOr<std::span<const uint8_t>> Next(size_t max_bytes) override;
  // Of an event that is no longer in memory only its number is known: "event 12".
  std::string PlaceOf(uint64_t byte_offset) const override;

 private:
  std::vector<PlainEvent> block_;
  uint64_t block_first_ = 0;  // number of block_.front(), from 0
  size_t next_ = 0;           // in the block
};

}  // namespace rigcal::agent

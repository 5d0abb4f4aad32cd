// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "agent/event_files/event_file.h"
#include "agent/event_files/plain_event_reader.h"

namespace rigcal::agent {

// A CSV or HDF5 file as a stream of EventFormat::kPlain.
class PlainEventFile : public EventFile {
 public:
  static constexpr size_t kBlockEvents = size_t{1} << 16;

  PlainEventFile(std::unique_ptr<PlainEventReader> reader, uint64_t byte_count);

  const EventFileHeader& header() const override { return header_; }
  uint64_t byte_count() const override { return byte_count_; }
  uint64_t byte_offset() const override { return (block_first_ + next_) * sizeof(PlainEvent); }
  absl::StatusOr<std::span<const uint8_t>> Next(size_t max_bytes) override;
  // Of an event that is no longer in memory only its number is known: "event 12".
  std::string PlaceOf(uint64_t byte_offset) const override;
  std::vector<Refusal> Refused() const override { return reader_->Refused(); }

 private:
  std::unique_ptr<PlainEventReader> reader_;
  EventFileHeader header_;
  uint64_t byte_count_;
  std::vector<PlainEvent> block_;
  uint64_t block_first_ = 0;  // number of block_.front(), from 0
  size_t next_ = 0;           // in the block
};

}  // namespace rigcal::agent

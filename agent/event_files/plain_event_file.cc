// SPDX-License-Identifier: Apache-2.0
#include "agent/event_files/plain_event_file.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {

PlainEventFile::PlainEventFile(std::unique_ptr<PlainEventReader> reader, uint64_t byte_count)
    : reader_(std::move(reader)), byte_count_(byte_count) {
  const PlainFileFacts& facts = reader_->facts();
  header_.format = EventFormat::kPlain;
  header_.format_name = facts.format;
  header_.layout = facts.layout;
  header_.time_unit = facts.time_unit;
  header_.geometry = facts.geometry;
  header_.fields = facts.fields;
}

absl::StatusOr<std::span<const uint8_t>> PlainEventFile::Next(size_t max_bytes) {
  if (next_ == block_.size()) {
    block_first_ += block_.size();
    next_ = 0;
    RIGCAL_RETURN_IF_ERROR(reader_->Read(kBlockEvents, &block_));
  }
  const size_t count = std::min(block_.size() - next_, max_bytes / sizeof(PlainEvent));
  const std::span<const PlainEvent> piece = std::span(block_).subspan(next_, count);
  next_ += count;
  return std::span(reinterpret_cast<const uint8_t*>(piece.data()), piece.size_bytes());
}

std::string PlainEventFile::PlaceOf(uint64_t byte_offset) const {
  const uint64_t event = byte_offset / sizeof(PlainEvent);
  if (event >= block_first_ && event - block_first_ < block_.size()) {
    const std::string place = reader_->PlaceOf(static_cast<size_t>(event - block_first_));
    if (!place.empty()) return place;
  }
  return absl::StrCat("event ", event);
}

}  // namespace rigcal::agent

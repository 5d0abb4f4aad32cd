// SPDX-License-Identifier: Apache-2.0
#include "agent/spool/disk/segment_scanner.h"

#include <algorithm>
#include <string_view>
#include <utility>

namespace rigcal::agent {

void SegmentScanner::Fill() {
  buffer_offset_ += position_;
  buffer_.erase(0, position_);
  position_ = 0;
  const uint64_t from = buffer_offset_ + buffer_.size();
  const auto wanted = static_cast<size_t>(
      std::min<uint64_t>(piece_bytes_, kMaxSegmentBytes - std::min(from, kMaxSegmentBytes)));
  absl::StatusOr<std::string> piece = file_->ReadAt(from, wanted);
  if (!piece.ok()) piece = file_->ReadAt(from, wanted);
  // What cannot be read is lost like what is damaged.
  if (!piece.ok() || piece->size() < piece_bytes_) at_end_ = true;
  if (!piece.ok()) return;
  if (buffer_.empty()) {
    buffer_ = *std::move(piece);
  } else {
    buffer_ += *piece;
  }
}

std::optional<RecordView> SegmentScanner::Next() {
  const uint64_t last_record_end = offset();
  while (true) {
    const std::string_view rest = std::string_view(buffer_).substr(position_);
    if (const std::optional<RecordView> record = RecordAtFront(rest)) {
      position_ += record->size;
      return record;
    }
    const bool short_of_bytes = rest.size() < kRecordPrefixBytes || MayContinue(rest);
    if (!at_end_ && short_of_bytes && rest.size() < kRecordPrefixBytes + kMaxRecordBytes) {
      Fill();
      continue;
    }
    if (rest.size() < kRecordPrefixBytes) {
      tail_bytes_ = offset() + rest.size() - last_record_end;
      return std::nullopt;
    }
    position_ += NextCandidate(rest, 1);
  }
}

}  // namespace rigcal::agent

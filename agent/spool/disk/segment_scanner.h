// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "agent/spool/disk/file_system.h"
#include "agent/spool/disk/segment_format.h"

namespace rigcal::agent {

// Reads the intact records of a segment one after the other, and goes on behind damaged bytes.
// What is behind kMaxSegmentBytes is not looked at: a damaged size must not cost hours.
// Reads pieces of `piece_bytes`, and holds at most two of them, or one record.
class SegmentScanner {
 public:
  // `offset`: of a record, or of anything in front of one.
  SegmentScanner(std::shared_ptr<SpoolFile> file, uint64_t offset,
                 size_t piece_bytes = kMaxRecordBytes)
      : file_(std::move(file)), piece_bytes_(piece_bytes), buffer_offset_(offset) {}

  // None: there is no other one. The view is good until the next call.
  std::optional<RecordView> Next();
  // Behind the record that Next returned.
  uint64_t offset() const { return buffer_offset_ + position_; }
  // Bytes behind the last record that are none; known once Next has returned none.
  uint64_t tail_bytes() const { return tail_bytes_; }

 private:
  void Fill();

  const std::shared_ptr<SpoolFile> file_;
  const size_t piece_bytes_;
  uint64_t buffer_offset_;
  std::string buffer_;
  size_t position_ = 0;
  uint64_t tail_bytes_ = 0;
  bool at_end_ = false;
};

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/event/raw_header.h"

namespace rigcal::agent {

// Bytes of one word of a format.
size_t WordBytes(EventFormat format);

// A RAW file of an event camera, read in blocks. Holds one block in memory, however large the file.
// Movable; one thread at a time.
class RawEventFile {
 public:
  static constexpr size_t kBlockBytes = size_t{1} << 20;

  // NOT_FOUND: no such file. FAILED_PRECONDITION: it cannot be read. INVALID_ARGUMENT: the header
  // (ParseRawHeader). Each names the file.
  static absl::StatusOr<RawEventFile> Open(const std::string& path);
  RawEventFile(RawEventFile&& other) noexcept;
  RawEventFile& operator=(RawEventFile&& other) noexcept;
  ~RawEventFile();

  const RawHeader& header() const { return header_; }
  uint64_t byte_count() const { return byte_count_; }  // of the whole file, header included
  // Of the next piece, in the file.
  uint64_t byte_offset() const { return block_offset_ + next_; }

  // The next piece of at most `max_bytes`, which must be a multiple of 8: whole words, but for what
  // is left at the end of a truncated file. Empty: the end. Valid until the next call.
  // DATA_LOSS: a disk that cannot be read; the message says where.
  absl::StatusOr<std::span<const uint8_t>> Next(size_t max_bytes);

 private:
  RawEventFile(std::string path, int descriptor);
  // What follows the block in memory, up to `size` bytes.
  absl::Status Fill(size_t size);

  std::string path_;
  int descriptor_ = -1;
  RawHeader header_;
  uint64_t byte_count_ = 0;
  std::vector<uint8_t> block_;
  uint64_t block_offset_ = 0;  // of block_.front() in the file
  size_t next_ = 0;            // in the block
};

}  // namespace rigcal::agent

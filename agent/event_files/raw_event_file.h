// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/event_files/event_file.h"

namespace rigcal::agent {

// Bytes of one word of a format.
size_t WordBytes(EventFormat format);

// "EVT3" and so on.
std::string EventFormatName(EventFormat format);

// A RAW file of an event camera, read in blocks. Holds one block in memory, however large the file.
// Movable; one thread at a time.
class RawEventFile : public EventFile {
 public:
  static constexpr size_t kBlockBytes = size_t{1} << 20;

  // NOT_FOUND: no such file. FAILED_PRECONDITION: it cannot be read. INVALID_ARGUMENT: the header
  // (ParseRawHeader). Each names the file.
  static absl::StatusOr<RawEventFile> Open(const std::string& path);
  RawEventFile(RawEventFile&& other) noexcept;
  RawEventFile& operator=(RawEventFile&& other) noexcept;
  ~RawEventFile() override;

  const EventFileHeader& header() const override { return header_; }
  uint64_t byte_count() const override { return byte_count_; }
  uint64_t byte_offset() const override { return block_offset_ + next_; }
  absl::StatusOr<std::span<const uint8_t>> Next(size_t max_bytes) override;
  std::string PlaceOf(uint64_t byte_offset) const override;

 private:
  RawEventFile(std::string path, int descriptor);
  // What follows the block in memory, up to `size` bytes.
  absl::Status Fill(size_t size);

  std::string path_;
  int descriptor_ = -1;
  EventFileHeader header_;
  uint64_t byte_count_ = 0;
  std::vector<uint8_t> block_;
  uint64_t block_offset_ = 0;  // of block_.front() in the file
  size_t next_ = 0;            // in the block
};

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
#include "agent/event_files/raw_event_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/event_files/raw_header.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr size_t kBlockBytes = size_t{1} << 20;

class RawEventFile : public EventFile {
 public:
  RawEventFile(std::string path, int descriptor)
      : path_(std::move(path)), descriptor_(descriptor) {}
  ~RawEventFile() override { ::close(descriptor_); }
  RawEventFile(const RawEventFile&) = delete;
  RawEventFile& operator=(const RawEventFile&) = delete;

  absl::Status ReadHeader(Evt21Order order);
  uint64_t byte_offset() const override { return block_offset_ + next_; }
  absl::StatusOr<std::span<const uint8_t>> Next(size_t max_bytes) override;
  std::string PlaceOf(uint64_t byte_offset) const override {
    return absl::StrCat("byte ", byte_offset);
  }

 private:
  // What follows the block in memory, until it is full or the file ends.
  absl::Status Fill();

  const std::string path_;
  const int descriptor_;
  std::vector<uint8_t> block_;
  uint64_t block_offset_ = 0;  // of block_.front() in the file
  size_t next_ = 0;            // in the block
};

absl::Status RawEventFile::ReadHeader(Evt21Order order) {
  RIGCAL_RETURN_IF_ERROR(Fill());
  auto header = ParseRawHeader(block_);
  if (!header.ok()) {
    return InvalidFile(path_, ": ", std::string(header.status().message()));
  }
  header_ = *std::move(header);
  if (header_.format == EventFormat::kEvt21) {
    if (!header_.states_endianness) header_.halves_swapped = true;
    if (order != Evt21Order::kAuto) header_.halves_swapped = order == Evt21Order::kLegacy;
  }
  next_ = header_.byte_count;
  return absl::OkStatus();
}

absl::Status RawEventFile::Fill() {
  size_t filled = block_.size();
  block_.resize(kBlockBytes);
  absl::Status status;
  while (filled < kBlockBytes) {
    const uint64_t offset = block_offset_ + filled;
    const ssize_t got = ::pread(descriptor_, block_.data() + filled, kBlockBytes - filled,
                                static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) {
      status = absl::DataLossError(
          absl::StrCat("cannot read ", path_, " at byte ", offset, ": ", std::strerror(errno)));
    }
    if (got <= 0) break;
    filled += static_cast<size_t>(got);
  }
  block_.resize(filled);
  return status;
}

absl::StatusOr<std::span<const uint8_t>> RawEventFile::Next(size_t max_bytes) {
  const size_t word = WordBytes(header_.format);
  if (block_.size() - next_ < word) {
    block_.erase(block_.begin(), block_.begin() + static_cast<std::ptrdiff_t>(next_));
    block_offset_ += std::exchange(next_, 0);
    RIGCAL_RETURN_IF_ERROR(Fill());
  }
  size_t size = std::min(block_.size() - next_, max_bytes);
  if (size > word) size -= size % word;
  const std::span<const uint8_t> piece = std::span(block_).subspan(next_, size);
  next_ += size;
  return piece;
}

}  // namespace

absl::StatusOr<std::unique_ptr<EventFile>> OpenRawEvents(const std::string& path,
                                                         const EventFileOptions& options) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return absl::ErrnoToStatus(errno, absl::StrCat("cannot open ", path));
  auto file = std::make_unique<RawEventFile>(path, descriptor);
  RIGCAL_RETURN_IF_ERROR(file->ReadHeader(options.evt21_order));
  return file;
}

}  // namespace rigcal::agent

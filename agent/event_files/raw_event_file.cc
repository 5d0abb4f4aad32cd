// SPDX-License-Identifier: Apache-2.0
#include "agent/event_files/raw_event_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "agent/event/event_decoder.h"
#include "agent/event/plain_events.h"
#include "agent/event_files/raw_header.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {

size_t WordBytes(EventFormat format) {
  switch (format) {
    case EventFormat::kEvt2:
      return Evt2Decoder::kWordBytes;
    case EventFormat::kEvt21:
      return Evt21Decoder::kWordBytes;
    case EventFormat::kEvt3:
      return Evt3Decoder::kWordBytes;
    case EventFormat::kPlain:
      break;
  }
  return PlainEventDecoder::kWordBytes;
}

std::string EventFormatName(EventFormat format) {
  switch (format) {
    case EventFormat::kEvt2:
      return "EVT2";
    case EventFormat::kEvt21:
      return "EVT21";
    case EventFormat::kEvt3:
      return "EVT3";
    case EventFormat::kPlain:
      break;
  }
  return "plain";
}

absl::StatusOr<RawEventFile> RawEventFile::Open(const std::string& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) {
    const int error = errno;
    const std::string what = absl::StrCat("cannot open ", path, ": ", std::strerror(error));
    if (error == ENOENT) return absl::NotFoundError(what);
    return absl::FailedPreconditionError(what);
  }
  RawEventFile file(path, descriptor);
  struct stat status = {};
  if (::fstat(descriptor, &status) != 0 || !S_ISREG(status.st_mode)) {
    return absl::FailedPreconditionError(absl::StrCat(path, " is no file that can be read"));
  }
  file.byte_count_ = static_cast<uint64_t>(status.st_size);
  RIGCAL_RETURN_IF_ERROR(file.Fill(kBlockBytes));
  absl::StatusOr<RawHeader> header = ParseRawHeader(file.block_);
  if (!header.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": ", std::string(header.status().message())));
  }
  file.header_ = {.format = header->format,
                  .halves_swapped = header->halves_swapped,
                  .format_name = EventFormatName(header->format),
                  .layout = "",
                  .time_unit = TimeUnit::kAuto,
                  .geometry = header->geometry,
                  .byte_count = header->byte_count,
                  .fields = std::move(header->fields)};
  file.next_ = static_cast<size_t>(file.header_.byte_count);
  return file;
}

RawEventFile::RawEventFile(std::string path, int descriptor)
    : path_(std::move(path)), descriptor_(descriptor) {}

RawEventFile::RawEventFile(RawEventFile&& other) noexcept { *this = std::move(other); }

RawEventFile& RawEventFile::operator=(RawEventFile&& other) noexcept {
  std::swap(path_, other.path_);
  std::swap(descriptor_, other.descriptor_);
  std::swap(header_, other.header_);
  std::swap(byte_count_, other.byte_count_);
  std::swap(block_, other.block_);
  std::swap(block_offset_, other.block_offset_);
  std::swap(next_, other.next_);
  return *this;
}

RawEventFile::~RawEventFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

absl::Status RawEventFile::Fill(size_t size) {
  size_t filled = block_.size();
  block_.resize(size);
  while (filled < size) {
    const ssize_t got = ::pread(descriptor_, block_.data() + filled, size - filled,
                                static_cast<off_t>(block_offset_ + filled));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) {
      const int error = errno;
      block_.resize(filled);
      return absl::DataLossError(absl::StrCat("cannot read ", path_, " at byte ",
                                              block_offset_ + filled, ": ", std::strerror(error)));
    }
    if (got == 0) break;
    filled += static_cast<size_t>(got);
  }
  block_.resize(filled);
  return absl::OkStatus();
}

absl::StatusOr<std::span<const uint8_t>> RawEventFile::Next(size_t max_bytes) {
  const size_t word = WordBytes(header_.format);
  if (block_.size() - next_ < word) {
    block_.erase(block_.begin(), block_.begin() + static_cast<std::ptrdiff_t>(next_));
    block_offset_ += next_;
    next_ = 0;
    RIGCAL_RETURN_IF_ERROR(Fill(kBlockBytes));
  }
  size_t size = std::min(block_.size() - next_, max_bytes);
  if (size > word) size -= size % word;
  const std::span<const uint8_t> piece = std::span(block_).subspan(next_, size);
  next_ += size;
  return piece;
}

std::string RawEventFile::PlaceOf(uint64_t byte_offset) const {
  return absl::StrCat("byte ", byte_offset);
}

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
#include "common/text/line_reader.h"

#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"

namespace rigcal::agent {
namespace {

constexpr size_t kBufferBytes = size_t{64} * 1024;
constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";

}  // namespace

absl::StatusOr<LineReader> LineReader::Open(const std::string& path) {
  // Asked before opening: to open a pipe would wait for its other end.
  struct stat facts {};
  if (stat(path.c_str(), &facts) != 0) {
    return absl::ErrnoToStatus(errno, absl::StrCat("cannot open ", path));
  }
  if (!S_ISREG(facts.st_mode)) {
    return absl::FailedPreconditionError(absl::StrCat(path, " is not a regular file"));
  }
  std::FILE* file = std::fopen(path.c_str(), "rbe");
  if (file == nullptr) return absl::ErrnoToStatus(errno, absl::StrCat("cannot open ", path));
  return LineReader(path, file);
}

LineReader::LineReader(std::string path, std::FILE* file)
    : path_(std::move(path)), file_(file, std::fclose), buffer_(kBufferBytes) {}

absl::StatusOr<std::optional<LineReader::Line>> LineReader::Next() {
  line_.clear();
  bool too_long = false;
  bool has_line = false;
  for (bool ended = false; !ended;) {
    if (begin_ == end_) {
      begin_ = 0;
      end_ = std::fread(buffer_.data(), 1, buffer_.size(), file_.get());
      if (end_ == 0) {
        if (std::ferror(file_.get()) != 0) {
          return absl::DataLossError(absl::StrCat("cannot read ", path_, " beyond line ", number_));
        }
        break;
      }
    }
    has_line = true;
    const char* start = buffer_.data() + begin_;
    const void* newline = std::memchr(start, '\n', end_ - begin_);
    ended = newline != nullptr;
    const size_t size =
        ended ? static_cast<size_t>(static_cast<const char*>(newline) - start) : end_ - begin_;
    // One byte more than a line may have, for the CR of a CRLF.
    const size_t room = kMaxLineBytes + 1 - line_.size();
    too_long = too_long || size > room;
    line_.append(start, std::min(size, room));
    begin_ += size + (ended ? 1 : 0);
  }
  if (!has_line) return std::nullopt;

  std::string_view text = line_;
  if (++number_ == 1 && text.starts_with(kByteOrderMark)) text.remove_prefix(kByteOrderMark.size());
  if (!too_long && text.ends_with('\r')) text.remove_suffix(1);
  too_long = too_long || text.size() > kMaxLineBytes;
  return Line{.text = text, .number = number_, .too_long = too_long};
}

}  // namespace rigcal::agent

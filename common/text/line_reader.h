// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"

namespace rigcal::agent {

// Reads a text file line by line in bounded memory, however long its lines are. Lines end with LF
// or CRLF; a byte order mark at the beginning is skipped. For one thread.
class LineReader {
 public:
  struct Line {
    std::string_view text;  // without its end; valid until the next call
    uint64_t number = 0;    // from 1
    bool too_long = false;  // `text` holds only the beginning
  };

  static constexpr size_t kMaxLineBytes = 8192;

  // NOT_FOUND, PERMISSION_DENIED or FAILED_PRECONDITION (no regular file), naming the file.
  static absl::StatusOr<LineReader> Open(const std::string& path);

  // The next line, blank ones included; none at the end. DATA_LOSS: the file cannot be read on.
  absl::StatusOr<std::optional<Line>> Next();

 private:
  LineReader(std::string path, std::FILE* file);

  std::string path_;
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_;
  std::vector<char> buffer_;
  size_t begin_ = 0;
  size_t end_ = 0;
  std::string line_;
  uint64_t number_ = 0;
};

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/stat.h>

#include <cerrno>
#include <filesystem>
#include <functional>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/file/durable_file.h"

namespace rigcal::server {

// The largest list of certificates that is read: some 100 000 of them.
inline constexpr size_t kMaxCertificateListBytes = size_t{16} << 20;

// What a file says that this or another process replaces now and then. Not for several threads.
template <typename Content>
class WatchedFile {
 public:
  using Parse = std::function<absl::StatusOr<Content>(const std::string& text)>;

  WatchedFile(std::filesystem::path path, Parse parse)
      : path_(std::move(path)), parse_(std::move(parse)) {}

  const std::filesystem::path& path() const { return path_; }
  // As of the last Refresh; empty where there is no file, or it cannot be used.
  const Content& content() const { return content_; }

  // Reads the file again where it has changed; else this is one system call. Errors are those of
  // the file system and of `parse`, the same until the file changes.
  absl::Status Refresh() {
    struct stat now = {};
    const bool exists = stat(path_.c_str(), &now) == 0;
    if (!exists && errno == ENOENT) {
      seen_ = {};
      content_ = {};
      return state_ = absl::OkStatus();
    }
    if (exists && IsSame(now, seen_)) return state_;
    absl::StatusOr<Content> read = Read();
    // What cannot be read for another reason than damage is tried again.
    seen_ = {};
    if (read.ok() || absl::IsDataLoss(read.status())) seen_ = now;
    state_ = read.status();
    content_ = read.ok() ? *std::move(read) : Content();
    return state_;
  }

 private:
  static bool IsSame(const struct stat& a, const struct stat& b) {
    return a.st_ino == b.st_ino && a.st_size == b.st_size && a.st_mtim.tv_sec == b.st_mtim.tv_sec &&
           a.st_mtim.tv_nsec == b.st_mtim.tv_nsec;
  }
  absl::StatusOr<Content> Read() const {
    const absl::StatusOr<std::string> text = ReadWholeFile(path_, kMaxCertificateListBytes);
    if (text.ok()) return parse_(*text);
    if (absl::IsNotFound(text.status())) return Content();
    return text.status();
  }

  const std::filesystem::path path_;
  const Parse parse_;
  struct stat seen_ = {};
  absl::Status state_;
  Content content_;
};

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace rigcal::agent {

// An open file of the spool. Thread-safe.
//
// Errors of all functions: RESOURCE_EXHAUSTED: no space, or beyond a quota. INTERNAL: any other
// error of the disk. Both name the file.
class SpoolFile {
 public:
  virtual ~SpoolFile() = default;
  // All of `bytes`, at `offset`. After an error, part of them may have been written.
  virtual absl::Status WriteAt(uint64_t offset, std::string_view bytes) = 0;
  // Fewer bytes than `size` only at the end of the file.
  virtual absl::StatusOr<std::string> ReadAt(uint64_t offset, size_t size) = 0;
  virtual absl::Status Truncate(uint64_t size) = 0;
  // Content and size survive power loss once it returns OK. After an error nobody knows which of
  // the writes do, and trying again would not tell.
  virtual absl::Status Sync() = 0;
};

// The few calls that the disk spool makes, so that tests can count them, let each of them fail, and
// cut the power between any two. Errors as for SpoolFile.
class FileSystem {
 public:
  struct Entry {
    std::string name;  // without folder
    uint64_t size = 0;
  };

  virtual ~FileSystem() = default;
  // A folder of mode 0700; OK where it exists.
  virtual absl::Status CreateFolder(const std::string& path) = 0;
  // The files in it, in no order.
  virtual absl::StatusOr<std::vector<Entry>> List(const std::string& folder) = 0;
  // A new file of mode 0600, empty; replaces one of that name.
  virtual absl::StatusOr<std::shared_ptr<SpoolFile>> Create(const std::string& path) = 0;
  // An existing file, for reading and writing. NOT_FOUND.
  virtual absl::StatusOr<std::shared_ptr<SpoolFile>> Open(const std::string& path) = 0;
  virtual absl::Status Rename(const std::string& from, const std::string& to) = 0;
  // OK where there is none.
  virtual absl::Status Remove(const std::string& path) = 0;
  // The names in the folder survive power loss once it returns OK.
  virtual absl::Status SyncFolder(const std::string& path) = 0;
  // Held until the returned object goes, or the process ends. ALREADY_EXISTS: another process has
  // it.
  virtual absl::StatusOr<std::shared_ptr<void>> Lock(const std::string& path) = 0;
};

// That of the operating system.
FileSystem& RealFileSystem();

}  // namespace rigcal::agent

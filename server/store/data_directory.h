// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <utility>

#include "absl/status/statusor.h"
#include "common/file/file_descriptor.h"

namespace rigcal::server {

// The folder with all data of a server, locked by one process at a time. Nobody but its user can
// enter it: folders of earlier releases are changed to mode 0700 and their files to 0600, which is
// logged.
class DataDirectory {
 public:
  // Creates the folder where it is missing. FAILED_PRECONDITION: another process holds it; its pid
  // is named where it is known. Or the folder, or a file of the server's in it, belongs to another
  // user or is a link, so that somebody could make the server write elsewhere. The lock ends with
  // this object or with the process, however that ends. It is on the folder itself and on a file
  // `lock` in it, so that it holds when somebody deletes that file.
  static absl::StatusOr<std::unique_ptr<DataDirectory>> Open(const std::filesystem::path& path);
  DataDirectory(const DataDirectory&) = delete;
  DataDirectory& operator=(const DataDirectory&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path database_file() const { return path_ / "rigcal.db"; }

  // Of its disk, for this user; none: it cannot be asked.
  std::optional<uint64_t> FreeBytes() const;

  // A file that reserves space for deleting when the disk is full. Fill does nothing where it is
  // filled already or the disk has no room for it.
  void FillReserve(size_t bytes);
  void ReleaseReserve();

 private:
  DataDirectory(std::filesystem::path path, FileDescriptor lock, FileDescriptor folder)
      : path_(std::move(path)), lock_(std::move(lock)), folder_(std::move(folder)) {}
  // Permissions of the files in the folder that are this server's; `changed`: of the folder as
  // well.
  absl::Status MakePrivate(bool changed) const;
  std::filesystem::path reserve_file() const { return path_ / "reserve"; }

  std::filesystem::path path_;
  FileDescriptor lock_;
  FileDescriptor folder_;
};

}  // namespace rigcal::server

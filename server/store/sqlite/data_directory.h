// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>

#include "absl/status/statusor.h"

namespace rigcal::server {

// The folder with all data of a server, locked by one process at a time.
class DataDirectory {
 public:
  // Creates the folder where it is missing. FAILED_PRECONDITION: another process holds it; its pid
  // is named. The lock ends with this object or with the process, however that ends.
  static absl::StatusOr<std::unique_ptr<DataDirectory>> Open(const std::filesystem::path& path);
  ~DataDirectory();
  DataDirectory(const DataDirectory&) = delete;
  DataDirectory& operator=(const DataDirectory&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path database_file() const { return path_ / "rigcal.db"; }

  // A file that reserves space for deleting when the disk is full. Fill does nothing where it is
  // filled already or the disk has no room for it.
  void FillReserve(size_t bytes);
  void ReleaseReserve();

 private:
  DataDirectory(std::filesystem::path path, int lock_fd)
      : path_(std::move(path)), lock_fd_(lock_fd) {}
  std::filesystem::path reserve_file() const { return path_ / "reserve"; }

  std::filesystem::path path_;
  int lock_fd_ = -1;
};

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "absl/status/statusor.h"

namespace rigcal::client {

// The folder for the store and logs of one `rigcal local`: a temporary one, removed with the
// object, or one that the user names, which stays. A temporary one is locked while its run lives;
// folders that killed runs left behind are removed by the next run.
class RunFolder {
 public:
  // `keep` empty: a temporary folder. Else it is created where it is missing. FAILED_PRECONDITION:
  // it cannot be created, or is not empty (runs are not mixed).
  static absl::StatusOr<RunFolder> Create(const std::filesystem::path& keep);

  RunFolder(RunFolder&& other) noexcept;
  RunFolder& operator=(RunFolder&&) = delete;
  ~RunFolder();

  const std::filesystem::path& path() const { return path_; }
  bool stays() const { return stays_; }

  std::filesystem::path Store() const { return path_ / "store"; }
  std::filesystem::path Logs() const { return path_ / "logs"; }
  std::filesystem::path Agents() const { return path_ / "agents"; }
  std::filesystem::path Export() const { return path_ / "export"; }

 private:
  RunFolder(std::filesystem::path path, bool stays, int lock)
      : path_(std::move(path)), stays_(stays), lock_(lock) {}

  std::filesystem::path path_;  // absolute; empty once moved from
  bool stays_;
  int lock_;  // descriptor, -1 with none
};

}  // namespace rigcal::client

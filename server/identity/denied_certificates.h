// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/stat.h>

#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <string_view>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace rigcal::server {

// Certificates that were revoked before their end, denied.json:
//   {"denied": [{"uri": "rigcal://agents/pc-1", "serials": ["4f2a...", ...], "time": "2026-..."}]}
// Serials are hexadecimal; in a file written by hand also in capitals and with colons. An entry
// without serials denies every certificate of that URI; rigcal writes none of these, so that a name
// can join again. Several objects and processes may use one file. Thread-safe.
class DeniedCertificates {
 public:
  explicit DeniedCertificates(std::filesystem::path file) : file_(std::move(file)) {}

  // `serial` is as in Certificate::serial. False where there is no file. Looks whether the file has
  // changed: one system call where it has not.
  // DATA_LOSS and errors of the file system: whom the file names is not known, so everybody must be
  // refused until it is repaired.
  absl::StatusOr<bool> Denies(std::string_view uri, std::string_view serial);
  // Adds to the file; on disk when it returns. Errors as above.
  absl::Status Deny(const std::string& uri, const std::set<std::string>& serials, absl::Time now);

 private:
  struct Entry {
    bool all = false;
    std::set<std::string, std::less<>> serials;
    std::string time;
  };
  using Entries = std::map<std::string, Entry, std::less<>>;  // by URI

  absl::StatusOr<Entries> Read() const;
  absl::Status ReadAgainIfChanged();  // with mutex_ held

  const std::filesystem::path file_;
  std::mutex mutex_;
  struct stat seen_ {};
  absl::Status state_;
  Entries entries_;
};

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/identity/watched_file.h"

namespace rigcal::server {

// Certificates that were revoked before their end, denied.json:
//   {"denied": [{"uri": "rigcal://agents/pc-1", "serials": ["4f2a...", ...], "all_but": ["77..."],
//                "time": "2026-..."}]}
// Serials are hexadecimal; in a file written by hand also in capitals and with colons. "all_but":
// every certificate of that URI is denied but these, which were given out after the revocation; so
// also those are denied of which there is no record any more. Without "all_but" only `serials` are,
// and, where there are none, every certificate of that URI for good; rigcal writes neither.
// Several objects and processes may use one file. Thread-safe.
class DeniedCertificates {
 public:
  explicit DeniedCertificates(std::filesystem::path file);

  // `serial` is as in Certificate::serial. False where there is no file. Looks whether the file has
  // changed: one system call where it has not.
  // DATA_LOSS and errors of the file system: whom the file names is not known, so everybody must be
  // refused until it is repaired.
  absl::StatusOr<bool> Denies(std::string_view uri, std::string_view serial);
  // Every certificate of this URI that has been given out so far; `serials` are those on record. On
  // disk when it returns. Errors as above.
  absl::Status Deny(const std::string& uri, const std::set<std::string>& serials, absl::Time now);
  // A certificate of this URI that is given out now, after those before were denied.
  absl::Status Accept(const std::string& uri, const std::string& serial);
  // Denies whatever `other` denies, too.
  absl::Status TakeAllOf(DeniedCertificates& other);

 private:
  struct Entry {
    bool for_good = false;  // every certificate, also of who joins again
    bool all = false;       // every certificate but `all_but`
    std::set<std::string, std::less<>> serials;
    std::set<std::string, std::less<>> all_but;
    std::string time;
  };
  using Entries = std::map<std::string, Entry, std::less<>>;  // by URI

  static absl::StatusOr<Entries> Parse(const std::filesystem::path& file, const std::string& text);
  absl::Status Refresh();  // with mutex_ held
  absl::Status Save(const Entries& entries);

  std::mutex mutex_;
  WatchedFile<Entries> file_;
  absl::Status logged_;
};

}  // namespace rigcal::server

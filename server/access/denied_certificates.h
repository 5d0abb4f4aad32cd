// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/stat.h>

#include <filesystem>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <utility>

#include "server/access/peer.h"

namespace rigcal::server {

// Certificates that were revoked before their end: a JSON file with
//   {"denied": [{"uri": "rigcal://agents/pc1", "serials": ["3FA2", ...]}, ...]}
// whose serial numbers are hexadecimal; an entry without any denies every certificate of its URI.
// Read again whenever the file has changed. A file that cannot be read or is damaged denies every
// certificate until it is repaired: whom it named is not known. No file: nobody is denied.
// Thread-safe.
class DeniedCertificates {
 public:
  explicit DeniedCertificates(std::filesystem::path file) : file_(std::move(file)) {}

  // Looks at the file, one system call where it has not changed.
  bool Denies(const Peer& peer);

 private:
  void ReadAgainIfChanged();  // with mutex_ held

  const std::filesystem::path file_;
  std::mutex mutex_;
  bool read_once_ = false;
  struct stat seen_ {};
  bool damaged_ = false;
  std::map<std::string, std::set<std::string>> serials_by_uri_;
};

}  // namespace rigcal::server

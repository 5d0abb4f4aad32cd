// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "absl/status/statusor.h"

namespace rigcal::server {

// The file `address` in a data directory: where the server that uses the directory can be reached
// from this machine. Written while it lives; a server that was killed leaves it behind.
class RunningServerNote {
 public:
  // Failing to write it is logged: only commands such as `rigcal-server compact` need it.
  RunningServerNote(const std::filesystem::path& data_directory, const std::string& address);
  ~RunningServerNote();
  RunningServerNote(const RunningServerNote&) = delete;
  RunningServerNote& operator=(const RunningServerNote&) = delete;

 private:
  const std::filesystem::path file_;
};

// NOT_FOUND: there is no note.
absl::StatusOr<std::string> AddressOfRunningServer(const std::filesystem::path& data_directory);

// How this machine reaches a server that listens on `listen` (HOST:PORT) and got `port`.
std::string LocalAddress(const std::string& listen, int port);

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace rigcal::agent {

// The highest generation of a server that this agent has spoken with, over all its runs: a server
// from which a standby has taken over has a lower one, and gets nothing any more. One file. For one
// thread.
class KnownServers {
 public:
  struct Server {
    std::string id;  // empty: none
    uint64_t generation = 0;
    std::string proof = {};  // ServerHello.generation_proof; empty: it gave none
  };

  // DATA_LOSS: the file is damaged; it is named.
  static absl::StatusOr<KnownServers> Open(std::filesystem::path file);

  const Server& Last() const { return last_; }
  // The server at `address` has introduced itself. Generation 0: of a release without them.
  // FAILED_PRECONDITION: another one has taken over from it. Else the errors of writing the file.
  absl::Status Meet(const std::string& address, const Server& server);

 private:
  explicit KnownServers(std::filesystem::path file) : file_(std::move(file)) {}

  std::filesystem::path file_;
  Server last_;
};

}  // namespace rigcal::agent

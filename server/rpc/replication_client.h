// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "server/replica/primary_link.h"

namespace rigcal::server {

// To the primary at HOST:PORT: on this machine without a certificate, else with that of the user
// who has joined it (`rigcal login`). FAILED_PRECONDITION: there is none; the message says what to
// do.
absl::StatusOr<std::unique_ptr<PrimaryLink>> LinkToPrimary(const std::string& address);

// What a promotion has found.
struct Promotion {
  uint64_t generation = 0;
  std::string primary;
  double silence_s = 0;  // below 0: it had never heard of the primary
  uint64_t missing_count = 0;
};

// Asks the standby that runs on this machine at `address` ("unix:/PATH") to take over. The errors
// of ReplicationService.Promote; UNAVAILABLE: none answers.
absl::StatusOr<Promotion> PromoteRunningServer(const std::string& address, bool force);

}  // namespace rigcal::server

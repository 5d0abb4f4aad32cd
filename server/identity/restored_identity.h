// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace rigcal::server {

// What a restore did to the identities of a backup, so that nobody is let in again.
struct RestoredIdentity {
  // There was none before, or one of another CA: nobody can tell who was revoked since the backup.
  bool compared = false;
  // URIs of who joined after the backup was made, and is out now; sorted.
  std::vector<std::string> joined_since;
  // Unused join strings of the backup that have been used or revoked since, or cannot be told.
  size_t closed_tokens = 0;
  // Browsers that have signed out or were revoked since.
  size_t ended_web_sessions = 0;
};

// Takes over into the identity folder of a backup (`restored`) what has happened since in the one
// that it replaces (`before`, which is only read): who was revoked stays so, who has renewed his
// certificate stays in, join strings that were used and browsers that have signed out stay so. Who
// joined since is not on record any more; his name is in the result.
//   DATA_LOSS  a list of `before` or of the backup is damaged, so that this cannot be done; the
//              message names the file and says what to do
absl::StatusOr<RestoredIdentity> TakeOverRevocations(const std::filesystem::path& before,
                                                     const std::filesystem::path& restored);

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "server/store/replica.h"

namespace rigcal::server {

// What `own` has and `primary` does not, where following would delete it, one line per record:
// "session wave, camera left: observations 901 to 1000". Sessions in
// `primary.deleted_sessions` are not among it.
std::vector<std::string> OwnExtras(const ReplicaListing& own, const ReplicaListing& primary);

// OK without extras. FAILED_PRECONDITION names the first of them and says what to do.
absl::Status RefuseExtras(const std::vector<std::string>& extras, const std::string& primary,
                          const std::string& data_dir);

}  // namespace rigcal::server

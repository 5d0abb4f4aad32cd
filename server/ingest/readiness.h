// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "absl/status/status.h"
#include "server/ingest/ingest.h"
#include "server/store/store.h"

namespace rigcal::server {

// Whether the server can take observations; also while none arrive. UNAVAILABLE: it cannot, and the
// message says why: the store or the writer has failed, the data folder cannot be written, or its
// disk has less left than the reserve.
absl::Status Readiness(const std::string& data_dir, const StoreHealth& store,
                       const IngestStats& ingest);

}  // namespace rigcal::server

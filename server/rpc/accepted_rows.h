// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "common/session/observation_batch.h"
#include "server/store/store.h"

namespace rigcal::server {

// The rows of a stored batch that were not refused, as one batch for each run of consecutive
// numbers. Clock samples and alignments are kept, with the first of them; a batch of none but
// refused rows with such samples gives one without rows.
std::vector<ObservationBatch> AcceptedRows(StoredBatch stored);

}  // namespace rigcal::server

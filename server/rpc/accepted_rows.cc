// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/accepted_rows.h"

#include <utility>

namespace rigcal::server {

std::vector<ObservationBatch> AcceptedRows(StoredBatch stored) {
  std::vector<ObservationBatch> batches;
  if (stored.refused_rows.empty()) {
    batches.push_back(std::move(stored.batch));
    return batches;
  }
  auto samples = std::exchange(stored.batch.clock_samples, {});
  auto alignments = std::exchange(stored.batch.host_alignments, {});
  const size_t rows = stored.batch.rows();
  for (size_t begin = 0; begin < rows;) {
    if (stored.refused_rows[begin]) {
      ++begin;
      continue;
    }
    size_t end = begin + 1;
    while (end < rows && !stored.refused_rows[end]) ++end;
    batches.push_back(stored.batch.Slice(begin, end));
    begin = end;
  }
  if (samples.empty() && alignments.empty()) return batches;
  if (batches.empty()) batches.push_back(stored.batch.Slice(0, 0));
  batches.front().clock_samples = std::move(samples);
  batches.front().host_alignments = std::move(alignments);
  return batches;
}

}  // namespace rigcal::server

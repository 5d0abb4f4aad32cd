// SPDX-License-Identifier: Apache-2.0
#include "server/store/delivery.h"

#include <utility>

namespace rigcal::server {
namespace {

template <typename... Columns>
size_t BytesOf(const Columns&... columns) {
  return (0 + ... + (columns.capacity() * sizeof(typename Columns::value_type)));
}

}  // namespace

size_t Delivery::Bytes() const {
  size_t bytes = sizeof(Delivery) +
                 BytesOf(batch.time_ns, batch.visible_mask, batch.x_px, batch.y_px,
                         batch.cov_xx_px2, batch.cov_xy_px2, batch.cov_yy_px2, batch.time_delta_ns,
                         batch.label_confidence, batch.centre_kind, batch.clock_samples,
                         batch.host_alignments, batch.dropped, refused_rows);
  if (!report) return bytes;
  bytes += BytesOf(report->refused);
  for (const Refusal& refusal : report->refused) bytes += refusal.example.capacity();
  return bytes;
}

std::vector<ObservationBatch> AcceptedRows(StoredBatch stored) {
  std::vector<ObservationBatch> batches;
  if (stored.damaged_rows > 0) return batches;
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

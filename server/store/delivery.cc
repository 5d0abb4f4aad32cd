// SPDX-License-Identifier: Apache-2.0
#include "server/store/delivery.h"

namespace rigcal::server {
namespace {

template <typename Value>
size_t ColumnBytes(const std::vector<Value>& column) {
  return column.capacity() * sizeof(Value);
}

}  // namespace

size_t Delivery::Bytes() const {
  size_t bytes = sizeof(Delivery) + ColumnBytes(batch.time_ns) + ColumnBytes(batch.visible_mask) +
                 ColumnBytes(batch.x_px) + ColumnBytes(batch.y_px) + ColumnBytes(batch.cov_xx_px2) +
                 ColumnBytes(batch.cov_xy_px2) + ColumnBytes(batch.cov_yy_px2) +
                 ColumnBytes(batch.time_delta_ns) + ColumnBytes(batch.label_confidence) +
                 ColumnBytes(batch.centre_kind) + ColumnBytes(batch.clock_samples) +
                 ColumnBytes(batch.host_alignments) + ColumnBytes(batch.dropped) +
                 ColumnBytes(refused_rows);
  if (!report) return bytes;
  bytes += ColumnBytes(report->refused);
  for (const Refusal& refusal : report->refused) bytes += refusal.example.capacity();
  return bytes;
}

}  // namespace rigcal::server

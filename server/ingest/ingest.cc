// SPDX-License-Identifier: Apache-2.0
#include "server/ingest/ingest.h"

#include "common/status/fault_list.h"

namespace rigcal::server {
namespace {

template <typename Value>
size_t ColumnBytes(const std::vector<Value>& column) {
  return column.capacity() * sizeof(Value);
}

size_t ReportBytes(const CameraReport& report) {
  size_t bytes = report.refused.capacity() * sizeof(Refusal);
  for (const Refusal& refusal : report.refused) {
    bytes += refusal.reason.capacity() + refusal.example.capacity();
  }
  return bytes;
}

}  // namespace

size_t Delivery::Bytes() const {
  size_t bytes = sizeof(Delivery) + ColumnBytes(batch.time_ns) + ColumnBytes(batch.visible_mask) +
                 ColumnBytes(batch.x_px) + ColumnBytes(batch.y_px) + ColumnBytes(batch.cov_xx_px2) +
                 ColumnBytes(batch.cov_xy_px2) + ColumnBytes(batch.cov_yy_px2) +
                 ColumnBytes(batch.time_delta_ns) + ColumnBytes(batch.label_confidence) +
                 ColumnBytes(batch.centre_kind) + ColumnBytes(batch.clock_samples) +
                 ColumnBytes(batch.host_alignments) + ColumnBytes(batch.dropped);
  for (const DroppedRange& dropped : batch.dropped) bytes += dropped.reason.capacity();
  if (end) bytes += ReportBytes(end->report);
  if (report) bytes += ReportBytes(*report);
  return bytes;
}

absl::Status IngestOptions::Validate() const {
  FaultList faults;
  if (queue_limit_bytes == 0) faults.Add("queue_limit_bytes must be at least 1");
  if (group_limit_bytes == 0) faults.Add("group_limit_bytes must be at least 1");
  if (send_window == 0) faults.Add("send_window must be at least 1 row");
  return faults.Result("ingest options: ");
}

}  // namespace rigcal::server

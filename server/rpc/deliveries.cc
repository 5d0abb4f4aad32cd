// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/deliveries.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/wire/observation_wire.h"

namespace rigcal::server {
absl::StatusOr<Delivery> ParseDelivery(const v1::ObservationBatch& proto, uint32_t max_rows) {
  if (static_cast<uint32_t>(proto.time_ns_size()) > max_rows) {
    return absl::InvalidArgumentError(absl::StrCat("batch.time_ns: has ", proto.time_ns_size(),
                                                   " rows, at most ", max_rows, " are allowed"));
  }
  Delivery delivery;
  RIGCAL_ASSIGN_OR_RETURN(delivery.batch, wire::FromProto(proto));
  return delivery;
}

absl::StatusOr<Delivery> ParseDelivery(const v1::EndOfCapture& proto) {
  RIGCAL_ASSIGN_OR_RETURN(EndOfCapture end, wire::FromProto(proto));
  Delivery delivery;
  delivery.batch.stream = std::move(end.stream);
  delivery.last_seq = end.last_seq;
  delivery.report = std::move(end.report);
  return delivery;
}

absl::StatusOr<Delivery> ParseDelivery(const v1::CameraReport& proto) {
  Delivery delivery;
  RIGCAL_ASSIGN_OR_RETURN(delivery.report, wire::FromProto(proto));
  delivery.batch.stream = delivery.report->stream;
  return delivery;
}

absl::StatusOr<Delivery> ParseDelivery(const v1::UploadBatchRequest& proto, uint32_t max_rows) {
  if (!proto.has_batch() && !proto.has_end_of_capture()) {
    return absl::InvalidArgumentError("batch: neither batch nor end_of_capture is set");
  }
  if (!proto.has_batch()) return ParseDelivery(proto.end_of_capture());
  RIGCAL_ASSIGN_OR_RETURN(Delivery delivery, ParseDelivery(proto.batch(), max_rows));
  if (!proto.has_end_of_capture()) return delivery;
  RIGCAL_ASSIGN_OR_RETURN(Delivery end, ParseDelivery(proto.end_of_capture()));
  if (end.stream() != delivery.stream()) {
    return absl::InvalidArgumentError(
        "end_of_capture: is of another session, camera or stream_epoch than batch");
  }
  end.batch = std::move(delivery.batch);
  return end;
}

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/deliveries.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/wire/observation_wire.h"

namespace rigcal::server {
namespace {

absl::Status TakeEnd(const v1::EndOfCapture& proto, Delivery* delivery) {
  RIGCAL_ASSIGN_OR_RETURN(EndOfCapture end, wire::FromProto(proto));
  delivery->batch.stream = std::move(end.stream);
  delivery->last_seq = end.last_seq;
  delivery->report = std::move(end.report);
  return absl::OkStatus();
}

}  // namespace

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
  Delivery delivery;
  RIGCAL_RETURN_IF_ERROR(TakeEnd(proto, &delivery));
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
  if (proto.has_end_of_capture()) {
    const StreamKey stream = delivery.stream();
    RIGCAL_RETURN_IF_ERROR(TakeEnd(proto.end_of_capture(), &delivery));
    if (delivery.stream() != stream) {
      return absl::InvalidArgumentError(
          "end_of_capture: is of another session, camera or stream_epoch than batch");
    }
  }
  return delivery;
}

}  // namespace rigcal::server

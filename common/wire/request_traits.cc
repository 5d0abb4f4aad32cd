// SPDX-License-Identifier: Apache-2.0
#include "common/wire/request_traits.h"

#include <algorithm>
#include <iterator>
#include <string>
#include <string_view>

#include "common/wire/grpc_status.h"
#include "common/wire/request_scan.h"
#include "google/protobuf/unknown_field_set.h"

namespace rigcal::wire {
namespace {

// Served by callbacks.
constexpr std::string_view kServedByCallbacks[] = {
    "rigcal.v1.CompactRequest",          "rigcal.v1.ConnectRequest",
    "rigcal.v1.ReadObservationsRequest", "rigcal.v1.TriangulateRequest",
    "rigcal.v1.UploadBatchRequest",      "rigcal.v1.WatchCalibrationRequest",
    "rigcal.v1.WatchSessionRequest"};
// The last number that a field can have; no message uses it.
constexpr int kFaultField = 536'870'911;

absl::Status ReadRequest(grpc::ByteBuffer* bytes, google::protobuf::Message* message) {
  {
    grpc::ProtoBufferReader reader(bytes);
    if (!reader.status().ok()) return absl::InvalidArgumentError("request: cannot be unpacked");
    absl::Status status = ScanRequest(*message->GetDescriptor(), &reader);
    if (!status.ok()) return status;
  }
  grpc::ProtoBufferReader reader(bytes);
  if (message->ParseFromZeroCopyStream(&reader)) return absl::OkStatus();
  return absl::InvalidArgumentError(
      "request: its bytes are no message of this kind (a text that is not UTF-8?)");
}

}  // namespace

grpc::Status ReadMessage(grpc::ByteBuffer* bytes, google::protobuf::MessageLite* lite) {
  auto* const message = dynamic_cast<google::protobuf::Message*>(lite);
  if (bytes == nullptr || message == nullptr || !IsRequest(*message->GetDescriptor())) {
    return grpc::GenericDeserialize<grpc::ProtoBufferReader, google::protobuf::MessageLite>(bytes,
                                                                                            lite);
  }
  const absl::Status status = ReadRequest(bytes, message);
  bytes->Clear();
  if (status.ok()) return grpc::Status::OK;
  message->Clear();
  if (std::ranges::find(kServedByCallbacks, message->GetDescriptor()->full_name()) ==
      std::end(kServedByCallbacks)) {
    return ToGrpc(status);
  }
  message->GetReflection()->MutableUnknownFields(message)->AddLengthDelimited(
      kFaultField, std::string(status.message()));
  return grpc::Status::OK;
}

absl::Status FaultOf(const google::protobuf::Message& request) {
  const google::protobuf::UnknownFieldSet& unknown =
      request.GetReflection()->GetUnknownFields(request);
  for (int i = 0; i < unknown.field_count(); ++i) {
    if (unknown.field(i).number() != kFaultField ||
        unknown.field(i).type() != google::protobuf::UnknownField::TYPE_LENGTH_DELIMITED) {
      continue;
    }
    return absl::InvalidArgumentError(unknown.field(i).length_delimited());
  }
  return absl::OkStatus();
}

}  // namespace rigcal::wire

// SPDX-License-Identifier: Apache-2.0
#pragma once

// Included by the generated services, so that gRPC checks every request before it makes a message
// of it (request_scan.h), whoever serves it.

#include <grpcpp/impl/codegen/proto_utils.h>

#include <concepts>
#include <type_traits>

#include "absl/status/status.h"
#include "google/protobuf/message.h"

namespace rigcal::wire {

// Makes the message from the bytes. For a request that fails, INVALID_ARGUMENT with the path of the
// field. gRPC answers a call whose request fails with UNIMPLEMENTED where it is served by
// callbacks; such requests come through, empty but for the fault, which FaultOf gives.
grpc::Status ReadMessage(grpc::ByteBuffer* bytes, google::protobuf::MessageLite* message);

// The fault that a request came with.
absl::Status FaultOf(const google::protobuf::Message& request);

}  // namespace rigcal::wire

namespace grpc {

// As gRPC's own, of which it takes precedence. Calls that are not served by callbacks come as
// MessageLite.
template <class T>
requires std::derived_from<T, google::protobuf::MessageLite>
class SerializationTraits<
    T, typename std::enable_if<std::is_base_of<grpc::protobuf::MessageLite, T>::value>::type> {
 public:
  static Status Serialize(const grpc::protobuf::MessageLite& message, ByteBuffer* bytes,
                          bool* own_buffer) {
    return GenericSerialize<ProtoBufferWriter, T>(message, bytes, own_buffer);
  }
  static Status Deserialize(ByteBuffer* bytes, grpc::protobuf::MessageLite* message) {
    return rigcal::wire::ReadMessage(bytes, message);
  }
};

}  // namespace grpc

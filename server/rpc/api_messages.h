// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <google/protobuf/message.h>

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/api/api_gateway.h"

namespace rigcal::server {

// Fills the request of an RPC: from the JSON body (protobuf JSON, the names of the proto files),
// the parameters of the query, and the variables of the path. INVALID_ARGUMENT names the field.
absl::Status FillMessage(const ApiRequest& request, google::protobuf::Message* message);

// Protobuf JSON with the names of the proto files, without fields that have their default.
absl::StatusOr<std::string> JsonOf(const google::protobuf::Message& message);

// The request and answer of "/rigcal.v1.SessionService/GetSession"; null: there is no such RPC.
const google::protobuf::MethodDescriptor* FindMethod(std::string_view rpc);

// A query can have this field: a scalar, a time or a duration, or several of them.
bool IsQueryField(const google::protobuf::FieldDescriptor& field);

}  // namespace rigcal::server

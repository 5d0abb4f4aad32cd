// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/server_context.h>

#include <string>
#include <utility>

#include "common/log/correlation_id.h"
#include "common/log/log_fields.h"
#include "server/rpc/call_guard.h"

namespace rigcal::server {

// The correlation id that came with a call, or a new one if none did, or one that is none.
std::string CorrelationOf(const grpc::ServerContextBase& context);

// A line about a call that ended with an error. None where the call was mistaken by itself
// (NOT_FOUND, INVALID_ARGUMENT, ALREADY_EXISTS), or GuardedCall has written one.
void LogRefusal(const char* rpc, const grpc::Status& status);

// As GuardedCall; what is logged meanwhile is about this call, and about `fields`. Its id goes back
// to the client with the initial metadata.
template <typename Body>
grpc::Status CorrelatedCall(const char* rpc, grpc::ServerContext* context, LogFields fields,
                            Body&& body) {
  fields.correlation = CorrelationOf(*context);
  context->AddInitialMetadata(kCorrelationKey, fields.correlation);
  const LogScope scope(fields);
  const grpc::Status status = GuardedCall(rpc, std::forward<Body>(body));
  LogRefusal(rpc, status);
  return status;
}

}  // namespace rigcal::server

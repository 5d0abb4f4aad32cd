// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/correlated_call.h"

namespace rigcal::server {

std::string CorrelationOf(const grpc::ServerContextBase& context) {
  const auto sent = context.client_metadata().find(kCorrelationKey);
  if (sent != context.client_metadata().end()) {
    const std::string id(sent->second.data(), sent->second.size());
    if (IsCorrelationId(id)) return id;
  }
  return NewCorrelationId();
}

void LogRefusal(const char* rpc, const grpc::Status& status) {
  switch (status.error_code()) {
    case grpc::StatusCode::OK:
    case grpc::StatusCode::NOT_FOUND:
    case grpc::StatusCode::INVALID_ARGUMENT:
    case grpc::StatusCode::ALREADY_EXISTS:
    case grpc::StatusCode::INTERNAL:
    case grpc::StatusCode::DATA_LOSS:
      return;
    default:
      spdlog::info("{} is refused: {}", rpc, status.error_message());
  }
}

}  // namespace rigcal::server

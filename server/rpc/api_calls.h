// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/channel.h>

#include <memory>

#include "server/api/api_gateway.h"
#include "server/rpc/call_security.h"

namespace rigcal::server {

// Calls of the JSON API, made over a channel in the process: the services answer them as all
// others, with the same checks of requests and lines in the audit log. `security` outlives it, and
// the server its calls.
std::unique_ptr<ApiGateway> MakeApiGateway(std::shared_ptr<grpc::Channel> channel,
                                           CallSecurity* security);

}  // namespace rigcal::server

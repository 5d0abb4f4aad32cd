// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/channel.h>

#include <memory>

#include "server/api/api_gateway.h"
#include "server/rpc/call_security.h"
#include "server/rpc/live_answers.h"

namespace rigcal::server {

// Calls of the JSON API, made over a channel in the process: the services answer them as all
// others, with the same checks of requests and lines in the audit log. Only a live state that the
// client has already is known without a call, from `live`. `security` and `live` outlive it, and
// the server its calls.
std::unique_ptr<ApiGateway> MakeApiGateway(std::shared_ptr<grpc::Channel> channel,
                                           CallSecurity* security, const LiveAnswers* live);

}  // namespace rigcal::server

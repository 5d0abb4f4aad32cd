// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "server/api/api_gateway.h"
#include "server/http/http_request.h"

namespace rigcal::server {

// The JSON API: what ApiRoutes lists, by calls of `gateway`, which outlives them.
std::vector<HttpRoute> ApiHttpRoutes(ApiGateway* gateway);

// The value of an If-None-Match with one entry, without quotes: "\"a-1\"" gives "a-1". Empty: it
// has another form.
std::string EtagOf(const std::string& if_none_match);

}  // namespace rigcal::server

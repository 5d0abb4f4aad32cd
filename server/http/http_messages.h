// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <boost/beast/core/error.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/string_body.hpp>
#include <optional>
#include <string>
#include <vector>

#include "server/http/http_server.h"

namespace rigcal::server {

using HttpRequestParser = boost::beast::http::request_parser<boost::beast::http::string_body>;
using BeastResponse = boost::beast::http::response<boost::beast::http::string_body>;

// Header and body of one request, no larger than the options allow.
void SetLimits(const HttpServerOptions& options, HttpRequestParser* parser);

// The answer to what `peer` (an IP address) sent: of its route, or an error of HTTP where it could
// not be read, after which the connection ends. None: the client is gone, or says nothing more.
std::optional<BeastResponse> AnswerTo(const HttpRequestParser& parser,
                                      boost::beast::error_code error, const std::string& peer,
                                      const std::vector<HttpRoute>& routes);

}  // namespace rigcal::server

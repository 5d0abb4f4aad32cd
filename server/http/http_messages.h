// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <boost/beast/core/error.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/string_body.hpp>
#include <optional>
#include <string>

#include "server/http/http_router.h"
#include "server/http/http_server.h"

namespace rigcal::server {

using HttpRequestParser = boost::beast::http::request_parser<boost::beast::http::string_body>;
using BeastResponse = boost::beast::http::response<boost::beast::http::string_body>;

// Where a request came from.
struct HttpOrigin {
  std::string peer;  // IP address
  bool tls = false;
  bool local = false;  // as HttpRequest::local
};

// Header and body of one request, no larger than the options allow.
void SetLimits(const HttpServerOptions& options, HttpRequestParser* parser);

// What the header says, once it has been read.
HttpRequest RequestOf(const HttpRequestParser& parser, const HttpOrigin& origin);

// The body of an admitted request may be as large as its route allows. An answer: it is larger.
std::optional<HttpResponse> LimitBody(const HttpRoute& route, HttpRequestParser* parser);

// The answer to a request that could not be read; none: the client is gone, or says nothing more.
std::optional<HttpResponse> AnswerToFault(boost::beast::error_code error);

// The answer of a route's `handle`, or to a fault in it.
HttpResponse Handled(const HttpWork& work);

// Compresses the body where the client takes that and it is worth it; takes some milliseconds for a
// large one.
void Compress(const HttpRequest& request, HttpResponse* response);

// As it is sent: without its body where the client has it.
BeastResponse ToBeast(const HttpRequest& request, HttpResponse response, bool keep_alive);

}  // namespace rigcal::server

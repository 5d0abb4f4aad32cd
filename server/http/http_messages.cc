// SPDX-License-Identifier: Apache-2.0
#include "server/http/http_messages.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <boost/beast/http/error.hpp>
#include <cstdint>
#include <string_view>
#include <utility>

#include "absl/time/clock.h"
#include "absl/time/time.h"

namespace rigcal::server {
namespace {

namespace http = boost::beast::http;
using BeastRequest = http::request<http::string_body>;

// The status for a request that could not be read; 0: the client is gone, there is none.
unsigned StatusOfBadRequest(boost::beast::error_code error) {
  if (error == http::error::body_limit) return 413;
  if (error == http::error::header_limit) return 431;
  if (error.category() == make_error_code(http::error::bad_method).category() &&
      error != http::error::end_of_stream && error != http::error::partial_message) {
    return 400;
  }
  return 0;
}

HttpResponse PlainResponse(unsigned status, std::string text) {
  return {.status = status, .body = std::move(text) + "\n"};
}

BeastResponse ToBeast(HttpResponse response, bool keep_alive) {
  BeastResponse message(static_cast<http::status>(response.status), 11);
  message.set(http::field::content_type, response.content_type);
  message.set(http::field::cache_control, "no-store");
  message.set("X-Content-Type-Options", "nosniff");
  // Clients compare it with their clock.
  message.set(http::field::date,
              absl::FormatTime("%a, %d %b %Y %H:%M:%S GMT", absl::Now(), absl::UTCTimeZone()));
  message.keep_alive(keep_alive);
  message.body() = std::move(response.body);
  message.prepare_payload();
  return message;
}

HttpResponse Route(const BeastRequest& request, const std::string& peer,
                   const std::vector<HttpRoute>& routes) {
  std::string path(request.target());
  path.resize(std::min(path.find('?'), path.size()));
  bool path_known = false;
  for (const HttpRoute& route : routes) {
    if (route.path != path) continue;
    path_known = true;
    if (route.method !=
        std::string_view(request.method_string().data(), request.method_string().size())) {
      continue;
    }
    try {
      return route.handle({.peer = peer, .body = request.body()});
    } catch (const std::exception& error) {
      spdlog::error("HTTPS {}: an unexpected fault: {}", path, error.what());
      return PlainResponse(500, "an unexpected fault");
    }
  }
  return path_known ? PlainResponse(405, "this path has another method")
                    : PlainResponse(404, "there is nothing here");
}

}  // namespace

void SetLimits(const HttpServerOptions& options, HttpRequestParser* parser) {
  parser->header_limit(static_cast<uint32_t>(options.max_header_bytes));
  parser->body_limit(options.max_body_bytes);
}

std::optional<BeastResponse> AnswerTo(const HttpRequestParser& parser,
                                      boost::beast::error_code error, const std::string& peer,
                                      const std::vector<HttpRoute>& routes) {
  if (!error) return ToBeast(Route(parser.get(), peer, routes), parser.get().keep_alive());
  const unsigned bad = StatusOfBadRequest(error);
  if (bad == 0) return std::nullopt;
  return ToBeast(PlainResponse(bad, error.message()), false);
}

}  // namespace rigcal::server

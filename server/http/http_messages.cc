// SPDX-License-Identifier: Apache-2.0
#include "server/http/http_messages.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <boost/beast/http/error.hpp>
#include <boost/beast/http/rfc7230.hpp>
#include <cstdint>
#include <iterator>
#include <string_view>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "server/api/gzip.h"

namespace rigcal::server {
namespace {

namespace http = boost::beast::http;
using boost::beast::string_view;

constexpr size_t kMinGzipBytes = 1024;
constexpr size_t kLargeBytes = size_t{128} << 10;

// Pages get what they need from this server, run nothing but its scripts, and are in no other page.
constexpr char kContentSecurityPolicy[] =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
    "font-src 'self'; connect-src 'self'; manifest-src 'self'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'";

std::string Text(string_view text) { return {text.data(), text.size()}; }

// The status for a request that could not be read; 0: the client is gone, there is none.
unsigned StatusOfFault(boost::beast::error_code error) {
  if (error == http::error::body_limit) return 413;
  if (error == http::error::header_limit) return 431;
  if (error.category() == make_error_code(http::error::bad_method).category() &&
      error != http::error::end_of_stream && error != http::error::partial_message) {
    return 400;
  }
  return 0;
}

bool AcceptsGzip(const std::string& accept) {
  for (absl::string_view coding : absl::StrSplit(accept, ',')) {
    const std::vector<absl::string_view> parts = absl::StrSplit(coding, ';');
    if (!absl::EqualsIgnoreCase(absl::StripAsciiWhitespace(parts[0]), "gzip")) continue;
    if (parts.size() == 1) return true;
    const absl::string_view weight = absl::StripAsciiWhitespace(parts[1]);
    return weight != "q=0" && weight != "q=0.0" && weight != "q=0.00" && weight != "q=0.000";
  }
  return false;
}

bool IsCompressible(std::string_view type) {
  return type.starts_with("text/") || type.starts_with("application/json") ||
         type.starts_with("application/javascript") || type.starts_with("image/svg");
}

// Whether the client has the body already.
bool HasEtag(const std::string& if_none_match, const std::string& etag) {
  if (if_none_match == "*") return true;
  const std::string quoted = absl::StrCat("\"", etag, "\"");
  for (absl::string_view part : absl::StrSplit(if_none_match, ',')) {
    part = absl::StripAsciiWhitespace(part);
    if (part.substr(0, 2) == "W/") part.remove_prefix(2);
    if (part == quoted) return true;
  }
  return false;
}

bool IsUnchanged(const HttpRequest& request, const HttpResponse& response) {
  if (response.status == 304) return true;
  const bool is_read = request.method == "GET" || request.method == "HEAD";
  return response.status == 200 && is_read && !response.etag.empty() &&
         HasEtag(request.if_none_match, response.etag);
}

// A value that ends no header line.
bool IsHeaderValue(const std::string& value) {
  return std::ranges::none_of(value, [](unsigned char c) { return c < 0x20 || c == 0x7f; });
}

void SetFields(const HttpResponse& response, BeastResponse* message) {
  message->set(http::field::cache_control, response.cache_control);
  message->set("X-Content-Type-Options", "nosniff");
  message->set("Referrer-Policy", "no-referrer");
  message->set("Content-Security-Policy", kContentSecurityPolicy);
  message->set("X-Frame-Options", "DENY");
  message->set("Cross-Origin-Opener-Policy", "same-origin");
  message->set("Cross-Origin-Resource-Policy", "same-origin");
  // Clients compare it with their clock.
  message->set(http::field::date,
               absl::FormatTime("%a, %d %b %Y %H:%M:%S GMT", absl::Now(), absl::UTCTimeZone()));
  if (!response.etag.empty()) message->set(http::field::etag, "\"" + response.etag + "\"");
  for (const auto& [name, value] : response.headers) {
    if (IsHeaderValue(value)) message->set(name, value);
  }
}

}  // namespace

void SetLimits(const HttpServerOptions& options, HttpRequestParser* parser) {
  parser->header_limit(static_cast<uint32_t>(options.max_header_bytes));
  parser->body_limit(options.max_body_bytes);
}

HttpRequest RequestOf(const HttpRequestParser& parser, const HttpOrigin& origin) {
  const auto& message = parser.get();
  HttpRequest request{.peer = origin.peer, .tls = origin.tls, .local = origin.local};
  request.method = Text(message.method_string());
  request.path = Text(message.target());
  if (const size_t query = request.path.find('?'); query != std::string::npos) {
    request.query = request.path.substr(query + 1);
    request.path.resize(query);
  }
  request.host = Text(message[http::field::host]);
  request.origin = Text(message[http::field::origin]);
  request.fetch_site = Text(message["Sec-Fetch-Site"]);
  request.cookie = Text(message[http::field::cookie]);
  request.authorization = Text(message[http::field::authorization]);
  request.if_none_match = Text(message[http::field::if_none_match]);
  for (const char* name : {"Host", "Origin", "Sec-Fetch-Site", "Cookie", "Authorization"}) {
    const auto [begin, end] = message.equal_range(name);
    if (std::distance(begin, end) > 1) request.repeated_field = name;
  }
  request.has_own_header = message.find("X-Rigcal") != message.end();
  request.accepts_gzip = AcceptsGzip(Text(message[http::field::accept_encoding]));
  return request;
}

std::optional<HttpResponse> LimitBody(const HttpRoute& route, HttpRequestParser* parser) {
  const auto length = parser->content_length();
  if (length && *length > route.max_body_bytes) {
    return ErrorResponse(413, absl::InvalidArgumentError(absl::StrCat(
                                  "the body may have ", route.max_body_bytes, " bytes")));
  }
  parser->body_limit(route.max_body_bytes);
  return std::nullopt;
}

std::optional<HttpResponse> AnswerToFault(boost::beast::error_code error) {
  const unsigned status = StatusOfFault(error);
  if (status == 0) return std::nullopt;
  return ErrorResponse(status, absl::InvalidArgumentError(error.message()));
}

HttpResponse Handled(const HttpWork& work) {
  try {
    return work();
  } catch (const std::exception& error) {
    spdlog::error("HTTP: an unexpected fault: {}", error.what());
    return ErrorResponse(absl::InternalError("an unexpected fault"));
  }
}

void Compress(const HttpRequest& request, HttpResponse* response) {
  constexpr int kFast = 1;
  constexpr int kUsual = 6;
  if (!request.accepts_gzip) response->gzipped.clear();
  if (!request.accepts_gzip || !response->gzipped.empty() || IsUnchanged(request, *response))
    return;
  if (response->body.size() < kMinGzipBytes || !IsCompressible(response->content_type)) return;
  response->gzipped = Gzipped(response->body, response->body.size() > kLargeBytes ? kFast : kUsual);
}

BeastResponse ToBeast(const HttpRequest& request, HttpResponse response, bool keep_alive) {
  const bool unchanged = IsUnchanged(request, response);
  BeastResponse message(
      unchanged ? http::status::not_modified : static_cast<http::status>(response.status), 11);
  SetFields(response, &message);
  message.keep_alive(keep_alive);
  message.set(http::field::vary, "Accept-Encoding");
  if (unchanged) return message;
  message.set(http::field::content_type, response.content_type);
  if (response.gzipped.empty()) {
    message.body() = std::move(response.body);
  } else {
    message.set(http::field::content_encoding, "gzip");
    message.body() = std::move(response.gzipped);
  }
  message.prepare_payload();
  // As GET, without what it would send.
  if (request.method == "HEAD") message.body().clear();
  return message;
}

}  // namespace rigcal::server

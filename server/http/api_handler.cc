// SPDX-License-Identifier: Apache-2.0
#include "server/http/api_handler.h"

#include <algorithm>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "common/identity/private_key.h"
#include "server/api/api_routes.h"

namespace rigcal::server {
namespace {

constexpr size_t kMaxApiBodyBytes = size_t{1} << 20;
constexpr size_t kMaxInfoBytes = 4096;
constexpr size_t kEtagBytes = 8;

bool IsRead(std::string_view method) { return method == "GET" || method == "HEAD"; }

// What stands between the quotes of an ETag.
bool IsEtagText(const std::string& text) {
  return !text.empty() && text.size() <= 200 && std::ranges::all_of(text, [](unsigned char c) {
    return c > 0x20 && c < 0x7f && c != '"';
  });
}

// What stands between the quotes of a Content-Disposition.
bool IsFileName(const std::string& name) {
  return !name.empty() && !name.starts_with('.') && std::ranges::all_of(name, [](unsigned char c) {
    return absl::ascii_isalnum(c) || c == '-' || c == '_' || c == '.';
  });
}

HttpResponse ResponseOf(const ApiRoute& route, const ApiAnswer& answer) {
  if (!answer.status.ok()) return ErrorResponse(answer.status);
  HttpResponse response{.content_type = std::string(route.content_type)};
  if (IsEtagText(answer.etag)) response.etag = answer.etag;
  if (answer.unchanged) {
    response.status = 304;
    return response;
  }
  response.body = answer.body->text;
  response.gzipped = answer.body->gzipped;
  if (answer.info.size() <= kMaxInfoBytes && !answer.info.empty()) {
    response.headers.emplace_back("X-Rigcal-Info", answer.info);
  }
  if (!answer.content_type.empty()) response.content_type = answer.content_type;
  if (IsFileName(answer.file_name)) {
    response.headers.emplace_back("Content-Disposition",
                                  absl::StrCat("attachment; filename=\"", answer.file_name, "\""));
  }
  const bool is_json = route.bytes_field.empty();
  if (response.etag.empty() && is_json && IsRead(route.method)) {
    response.etag = absl::BytesToHexString(Sha256(response.body).substr(0, kEtagBytes));
  }
  return response;
}

HttpResponse NoSuchRoute(const ApiMatch& match) {
  if (match.allowed_methods.empty()) {
    return ErrorResponse(
        absl::NotFoundError("there is nothing here; GET /v1/openapi.json describes the API"));
  }
  HttpResponse response = ErrorResponse(
      405, absl::InvalidArgumentError(absl::StrCat("this path has: ", match.allowed_methods)));
  response.headers.emplace_back("Allow", match.allowed_methods);
  return response;
}

void BeginCall(ApiGateway* gateway, HttpRequest request, std::function<void(HttpWork)> done) {
  const std::string method = request.method == "HEAD" ? "GET" : request.method;
  ApiMatch match = MatchApiRoute(method, request.path);
  if (match.route == nullptr) {
    done([match = std::move(match)] { return NoSuchRoute(match); });
    return;
  }
  absl::StatusOr<std::vector<UrlParameter>> parameters = ParseUrlQuery(request.query);
  if (!parameters.ok()) {
    done([status = parameters.status()] { return ErrorResponse(status); });
    return;
  }
  // A page asks for an image under a new address each time, or the browser shows it its old one.
  if (!match.route->bytes_field.empty()) {
    std::erase_if(*parameters, [](const UrlParameter& each) { return each.name == "turn"; });
  }
  const ApiRoute& route = *match.route;
  gateway->Call({.route = &route,
                 .variables = std::move(match.variables),
                 .parameters = *std::move(parameters),
                 .body = std::move(request.body),
                 .known_etag = EtagOf(request.if_none_match),
                 .peer = std::move(request.caller),
                 .address = std::move(request.peer)},
                [&route, done = std::move(done)](ApiGateway::Work work) {
                  done([&route, work = std::move(work)] { return ResponseOf(route, work()); });
                });
}

}  // namespace

std::string EtagOf(const std::string& if_none_match) {
  std::string_view etag = if_none_match;
  if (etag.starts_with("W/")) etag.remove_prefix(2);
  if (etag.size() < 2 || !etag.starts_with('"') || !etag.ends_with('"')) return "";
  const std::string text(etag.substr(1, etag.size() - 2));
  return IsEtagText(text) ? text : "";
}

std::vector<HttpRoute> ApiHttpRoutes(ApiGateway* gateway) {
  return {{.method = "",
           .path = "/v1/*",
           .begin =
               [gateway](HttpRequest request, std::function<void(HttpWork)> done) {
                 BeginCall(gateway, std::move(request), std::move(done));
               },
           .who = HttpRoute::For::kSignedIn,
           .max_body_bytes = kMaxApiBodyBytes}};
}

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#include "server/http/http_router.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "common/identity/join_string.h"
#include "common/status/status_macros.h"
#include "server/identity/server_identity.h"

namespace rigcal::server {
namespace {

using For = HttpRoute::For;

unsigned HttpStatusOf(absl::StatusCode code) {
  switch (code) {
    case absl::StatusCode::kOk:
      return 200;
    case absl::StatusCode::kInvalidArgument:
    case absl::StatusCode::kOutOfRange:
      return 400;
    case absl::StatusCode::kUnauthenticated:
      return 401;
    case absl::StatusCode::kPermissionDenied:
      return 403;
    case absl::StatusCode::kNotFound:
      return 404;
    case absl::StatusCode::kAborted:
    case absl::StatusCode::kAlreadyExists:
    case absl::StatusCode::kFailedPrecondition:
      return 409;
    case absl::StatusCode::kUnimplemented:
      return 501;
    case absl::StatusCode::kResourceExhausted:
    case absl::StatusCode::kUnavailable:
    case absl::StatusCode::kCancelled:
      return 503;
    case absl::StatusCode::kDeadlineExceeded:
      return 504;
    default:
      return 500;
  }
}

bool Matches(const HttpRoute& route, const std::string& path) {
  if (!route.path.ends_with('*')) return route.path == path;
  return path.starts_with(std::string_view(route.path).substr(0, route.path.size() - 1));
}

bool HasMethod(const HttpRoute& route, const std::string& method) {
  return route.method.empty() || route.method == method ||
         (route.method == "GET" && method == "HEAD");
}

bool IsRead(const std::string& method) { return method == "GET" || method == "HEAD"; }

// Whoever sent it: a page of this server, or no page at all.
absl::Status CheckOrigin(const HttpRequest& request) {
  const std::string own = absl::StrCat(request.tls ? "https://" : "http://", request.host);
  if (!request.origin.empty() && !absl::EqualsIgnoreCase(request.origin, own)) {
    return absl::PermissionDeniedError(absl::StrCat(
        "a page of ", absl::CHexEscape(request.origin.substr(0, 200)), " may not use this server"));
  }
  if (request.fetch_site == "cross-site" || request.fetch_site == "same-site") {
    return absl::PermissionDeniedError("a page of another site may not use this server");
  }
  if (IsRead(request.method) || request.has_own_header) return absl::OkStatus();
  return absl::PermissionDeniedError(
      "what changes something needs the header X-Rigcal: 1, which no page of another site can "
      "send");
}

// Without TLS from elsewhere: where it should have gone.
HttpResponse Redirect(const HttpRequest& request) {
  if (!IsRead(request.method) || HostOfHeader(request.host).empty()) {
    return ErrorResponse(absl::PermissionDeniedError(
        "this port speaks HTTPS; without TLS only this PC itself may use it"));
  }
  HttpResponse response = ErrorResponse(
      308,
      absl::PermissionDeniedError(absl::StrCat("this port speaks HTTPS: https://", request.host)));
  response.headers.emplace_back("Location",
                                absl::StrCat("https://", request.host, request.path,
                                             request.query.empty() ? "" : "?", request.query));
  return response;
}

}  // namespace

HttpResponse ErrorResponse(const absl::Status& status) {
  return ErrorResponse(HttpStatusOf(status.code()), status);
}

HttpResponse ErrorResponse(unsigned http_status, const absl::Status& status) {
  using Json = nlohmann::ordered_json;
  const Json json = {{"code", absl::StatusCodeToString(status.code())},
                     {"message", std::string(status.message())}};
  return {.status = http_status,
          .content_type = "application/json",
          .body = json.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n"};
}

std::string HostOfHeader(const std::string& header) {
  std::string host = header;
  if (!host.empty() && host.front() == '[') {
    const size_t end = host.find(']');
    if (end == std::string::npos) return "";
    const std::string port = host.substr(end + 1);
    if (!port.empty() && port.front() != ':') return "";
    host = host.substr(1, end - 1);
  } else if (const size_t colon = host.rfind(':'); colon != std::string::npos) {
    host.resize(colon);
  }
  return IsHostText(host) ? absl::AsciiStrToLower(host) : "";
}

absl::Status HttpRouter::CheckHost(const HttpRequest& request) const {
  const std::string host = HostOfHeader(request.host);
  if (!host.empty() && (IsLoopbackHost(host) || guards_.is_own_host(host))) {
    return absl::OkStatus();
  }
  return absl::PermissionDeniedError(
      absl::StrCat("this server is not '", absl::CHexEscape(request.host.substr(0, 200)),
                   "'; reach it by an address of its own, or add the name to [https] hosts in its "
                   "configuration"));
}

HttpRouter::Admission HttpRouter::Find(const HttpRequest& request) const {
  std::string allowed;
  for (const HttpRoute& route : routes_) {
    if (!Matches(route, request.path)) continue;
    if (HasMethod(route, request.method)) return {&route, std::nullopt};
    absl::StrAppend(&allowed, allowed.empty() ? "" : ", ", route.method);
  }
  if (allowed.empty())
    return {nullptr, ErrorResponse(absl::NotFoundError("there is nothing here"))};
  HttpResponse refusal = ErrorResponse(
      405, absl::InvalidArgumentError(absl::StrCat("this path has another method: ", allowed)));
  refusal.headers.emplace_back("Allow", allowed);
  return {nullptr, std::move(refusal)};
}

HttpRouter::Admission HttpRouter::Admit(HttpRequest* request) const {
  if (!request->repeated_field.empty()) {
    return {nullptr, ErrorResponse(400, absl::InvalidArgumentError(absl::StrCat(
                                            "the header field ", request->repeated_field,
                                            " is there more than once")))};
  }
  if (!request->tls && !request->local) return {nullptr, Redirect(*request)};
  Admission admission = Find(*request);
  if (admission.refusal || admission.route->who == For::kAnybody) return admission;
  const HttpRoute& route = *admission.route;
  absl::Status status = CheckHost(*request);
  if (status.ok() && route.who != For::kPages) status = CheckOrigin(*request);
  if (status.ok() && route.who == For::kSignedIn) {
    absl::StatusOr<Peer> caller = guards_.identify(*request);
    status = caller.status();
    if (caller.ok()) request->caller = *std::move(caller);
  }
  if (!status.ok()) admission.refusal = ErrorResponse(status);
  return admission;
}

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/http/http_request.h"

namespace rigcal::server {

// Whom a server lets in.
struct HttpGuards {
  // A host name or address (without port) under which this server is reached; loopback always is.
  std::function<bool(const std::string& host)> is_own_host = [](const std::string&) {
    return false;
  };
  // Who sent a request; its `local` is true only where that is enough.
  std::function<absl::StatusOr<Peer>(const HttpRequest&)> identify =
      [](const HttpRequest&) -> absl::StatusOr<Peer> {
    return absl::UnauthenticatedError("nobody can sign in here");
  };
};

// Which route a request takes, and whether it may. For many threads.
class HttpRouter {
 public:
  // Implicit: most tests need no guards.
  HttpRouter(std::vector<HttpRoute> routes = {}, HttpGuards guards = {})  // NOLINT
      : routes_(std::move(routes)), guards_(std::move(guards)) {}

  struct Admission {
    const HttpRoute* route = nullptr;
    std::optional<HttpResponse> refusal;  // without one there is a route
  };
  // Looks at all but the body. Sets the request's caller.
  Admission Admit(HttpRequest* request) const;

 private:
  Admission Find(const HttpRequest& request) const;
  absl::Status CheckHost(const HttpRequest& request) const;

  std::vector<HttpRoute> routes_;
  HttpGuards guards_;
};

// The host of a Host header: "localhost:7421" gives "localhost", "[::1]:7421" gives "::1". Empty:
// it is none.
std::string HostOfHeader(const std::string& header);

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "server/access/peer.h"
#include "server/api/api_routes.h"
#include "server/api/url_text.h"

namespace rigcal::server {

// A call of the JSON API.
struct ApiRequest {
  const ApiRoute* route = nullptr;
  std::vector<UrlParameter> variables;   // of the path
  std::vector<UrlParameter> parameters;  // of the query
  std::string body;                      // JSON; empty: {}
  std::string known_etag;                // what the client has; empty: nothing
  Peer peer;                             // who calls
  std::string address;                   // from where, for the audit log
};

// A text, and the same compressed where somebody has done so already.
struct ApiBody {
  std::string text;
  std::string gzipped;
};

// The answer to it.
struct ApiAnswer {
  absl::Status status = {};
  std::shared_ptr<const ApiBody> body = {};  // JSON, or what the route serves
  std::string etag = {};                     // names the body; empty: it has none
  bool unchanged = false;                    // the client has it: there is no body
  std::string info = {};                     // of an image: what is known of it, as JSON
  std::string content_type = {};             // of the body; empty: as the route says
  std::string file_name = {};                // of a download; empty: it is none
};

// Calls the services that the routes name, as gRPC does. Thread-safe.
class ApiGateway {
 public:
  virtual ~ApiGateway() = default;

  // Makes the answer; takes some milliseconds where it is large.
  using Work = std::function<ApiAnswer()>;
  // Checks who may call it, begins the call, and returns; `done` is called once, from any thread.
  // The errors are those of the RPC, and INVALID_ARGUMENT for a body or parameter that is none of
  // its request.
  virtual void Call(ApiRequest request, std::function<void(Work)> done) = 0;
  // May this peer call an RPC? Without a call.
  virtual absl::Status Check(const Peer& peer, std::string_view rpc) = 0;
};

}  // namespace rigcal::server

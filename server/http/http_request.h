// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "server/access/peer.h"

namespace rigcal::server {

struct HttpRequest {
  std::string peer;    // IP address of the client
  bool tls = false;    // it came over TLS
  bool local = false;  // it came without TLS from this machine, which is trusted
  std::string method = {};
  std::string path = {};   // percent-encoded, without the query
  std::string query = {};  // without the '?'
  // Header fields; empty: not there.
  std::string host = {};
  std::string origin = {};
  std::string fetch_site = {};  // Sec-Fetch-Site
  std::string cookie = {};
  std::string authorization = {};
  std::string if_none_match = {};
  // Of the fields above, one that came twice: two programs that look at the request may take
  // different ones of them.
  std::string repeated_field = {};
  bool has_own_header = false;  // X-Rigcal, which no page of another site can send
  bool accepts_gzip = false;
  std::string body = {};
  Peer caller = {};  // of routes for those who have signed in
};

struct HttpResponse {
  unsigned status = 200;
  std::string content_type = "text/plain; charset=utf-8";
  std::string body = {};
  std::string gzipped = {};  // the body, compressed already; empty: it is not
  std::string etag = {};     // names the body, without quotes; empty: it has none
  std::string cache_control = "no-store";
  std::vector<std::pair<std::string, std::string>> headers = {};
};

// Makes a response; may take some milliseconds.
using HttpWork = std::function<HttpResponse()>;

// What is done for a method and path.
struct HttpRoute {
  enum class For {
    kAnybody,   // programs that join; whatever address they use
    kPages,     // browsers, too: the host must be one of the server's
    kSignIn,    // as kPages, from the server's own pages only
    kSignedIn,  // as kSignIn, by those whom the server knows
  };

  std::string method;  // "GET", for HEAD too; empty: the route looks at it itself
  std::string path;    // "/v1/ca"; "/v1/*" for what has no route of its own
  // Answers at once, on the server's thread; or ...
  std::function<HttpResponse(const HttpRequest&)> handle = {};
  // ... on another one: calls its second argument once, from any thread.
  std::function<void(HttpRequest, std::function<void(HttpWork)>)> begin = {};
  For who = For::kAnybody;
  size_t max_body_bytes = size_t{64} << 10;
};

// {"code": "NOT_FOUND", "message": "..."} with the status that HTTP has for the code.
HttpResponse ErrorResponse(const absl::Status& status);
// The same with another status.
HttpResponse ErrorResponse(unsigned http_status, const absl::Status& status);

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "tests/testing/raw_socket.h"

namespace rigcal::testing {

struct HttpReply {
  int status = 0;
  std::string head;  // with the first line
  std::string body;

  // The first header of this name; empty: there is none.
  std::string Header(const std::string& name) const;
};

// A connection without TLS to an HTTP server on this machine, which stays open between requests
// (Content-Length only, as rigcal-server answers).
class HttpConnection {
 public:
  explicit HttpConnection(int port) : socket_(port) {}

  // `headers`: each with its line end. UNAVAILABLE: the server has closed the connection, or sends
  // nothing for 30 s.
  absl::StatusOr<HttpReply> Call(const std::string& method, const std::string& path,
                                 const std::string& headers = "", const std::string& body = "");
  absl::StatusOr<HttpReply> Get(const std::string& path, const std::string& headers = "") {
    return Call("GET", path, headers);
  }
  // The answer to what has been sent over `socket`.
  absl::StatusOr<HttpReply> Read(bool has_body = true);
  const RawSocket& socket() const { return socket_; }

 private:
  RawSocket socket_;
  std::string received_;
};

}  // namespace rigcal::testing

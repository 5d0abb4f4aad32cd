// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace rigcal::server {

struct HttpRequest {
  std::string peer;  // IP address of the client
  std::string body;
};

struct HttpResponse {
  unsigned status = 200;
  std::string content_type = "text/plain; charset=utf-8";
  std::string body;
};

// What is done for one method and path. Handlers run one at a time, on the server's thread.
struct HttpRoute {
  std::string method;  // "GET"
  std::string path;    // "/v1/ca"; what follows a '?' is not looked at
  std::function<HttpResponse(const HttpRequest&)> handle;
};

struct HttpServerOptions {
  std::string listen_address;  // HOST:PORT; port 0: any free one
  // PEM files; read again when `refresh` has run.
  std::filesystem::path certificate_file;
  std::filesystem::path key_file;
  // Runs every `refresh_interval`, to renew the certificate and the like.
  std::function<void()> refresh = [] {};
  std::chrono::milliseconds refresh_interval{30'000};
  // With so many connections the one that has been silent for the longest makes room.
  size_t max_connections = 256;
  size_t max_header_bytes = 8 << 10;
  size_t max_body_bytes = 64 << 10;
  // For the TLS handshake, and for a whole request.
  std::chrono::milliseconds request_timeout{10'000};
};

// HTTPS (HTTP/1.1, TLS 1.2 and 1.3) with one thread. No client can hold it up: connections, sizes
// and times are limited.
class HttpServer {
 public:
  HttpServer(HttpServerOptions options, std::vector<HttpRoute> routes);
  ~HttpServer();

  // Serves from here on; returns the port. UNAVAILABLE: the port is in use. FAILED_PRECONDITION:
  // certificate and key cannot be used.
  absl::StatusOr<int> Start();
  void Shutdown();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rigcal::server

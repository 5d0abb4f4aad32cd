// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/http/http_request.h"
#include "server/http/http_router.h"

namespace rigcal::server {

struct HttpServerOptions {
  std::string listen_address;  // HOST:PORT; port 0: any free one
  // PEM files; read again when `refresh` has run. Both empty: no TLS.
  std::filesystem::path certificate_file;
  std::filesystem::path key_file;
  // Clients on this machine are trusted without TLS. Others are sent to HTTPS.
  bool plain_loopback = true;
  // Runs every `refresh_interval`, to renew the certificate and the like.
  std::function<void()> refresh = [] {};
  std::chrono::milliseconds refresh_interval{30'000};
  // With so many connections, in all or from one address (of IPv6: a network of 64 bits), one makes
  // room: the oldest that has sent no request yet, else the one silent for the longest.
  size_t max_connections = 512;
  size_t max_connections_per_address = 256;
  // Requests that wait for an answer of `HttpRoute::begin`; more are refused.
  size_t max_calls = 64;
  size_t max_header_bytes = 16 << 10;
  size_t max_body_bytes = 1 << 20;  // of any route
  // For the TLS handshake, and for a whole request.
  std::chrono::milliseconds request_timeout{10'000};
  // For an answer of `HttpRoute::begin`.
  std::chrono::milliseconds answer_timeout{45'000};
  size_t worker_threads = 2;
};

struct HttpStats {
  size_t open_connections = 0;
  uint64_t accepted_connections = 0;
  uint64_t dropped_connections = 0;  // to make room
  uint64_t requests = 0;
  uint64_t refused_requests = 0;  // with a status of 400 or more
};

// HTTP/1.1 with TLS 1.2 and 1.3, and for this machine without, on one port: a connection is what
// its first byte says. One thread for the sockets, some for answers that take time. No client can
// hold it up: connections, sizes and times are limited.
class HttpServer {
 public:
  HttpServer(HttpServerOptions options, HttpRouter router);
  ~HttpServer();

  // Serves from here on; returns the port. UNAVAILABLE: the port is in use. FAILED_PRECONDITION:
  // certificate and key cannot be used.
  absl::StatusOr<int> Start();
  void Shutdown();
  HttpStats Stats() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rigcal::server

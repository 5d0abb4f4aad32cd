// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/api/api_gateway.h"
#include "server/audit/audit_log.h"
#include "server/http/http_server.h"
#include "server/http/waiting_routes.h"
#include "server/identity/identity_authority.h"

namespace rigcal::server {

struct WebServerOptions {
  std::filesystem::path data_dir;
  std::string grpc_listen;  // HOST:PORT
  // HOST:PORT of gRPC under which others are told to reach it; empty: as grpc_listen says.
  std::string advertised = {};
  // HOST:PORT; empty: the host of grpc_listen, port 7421 (any free one where gRPC takes any, or
  // where it is in use and only this machine could reach it).
  std::string https_listen;
  std::vector<std::string> hosts = {};  // further names under which browsers reach it
  bool plain_loopback = true;           // as in HttpServerOptions
  std::filesystem::path docs_dir = {};  // of the documentation; empty: DefaultDocsFolder()
  // Set: another server answers, and this one says so, and does nothing else.
  std::function<WaitingNotice()> waiting = {};
  AuditLog* audit = nullptr;  // who joined and who was refused; null: nothing is written
  // Whether the server takes data, for /readyz.
  std::function<absl::Status()> ready = [] { return absl::OkStatus(); };
};

// What the web server shows of the rest; all must outlive it.
struct WebServerParts {
  ApiGateway* gateway = nullptr;
  std::string api_description;           // for /v1/openapi.json
  std::function<std::string()> metrics;  // for /metrics, in the text format of Prometheus
};

// What the server's certificate is for: `advertised` (HOST:PORT; may be empty), and where others
// reach the two addresses (HOST:PORT; the second may be empty).
std::vector<std::string> CertificateHosts(const std::string& advertised,
                                          const std::string& grpc_listen,
                                          const std::string& https_listen);

// The port for browsers and for PCs that join: the dashboard, the JSON API, enrolment, metrics.
// With TLS where other PCs can reach the server; this PC needs none.
class WebServer {
 public:
  // Makes the identity where others can reach the server and it is missing, with the errors of
  // EnsureServerIdentity and IdentityAuthority::Open.
  static absl::StatusOr<std::unique_ptr<WebServer>> Open(WebServerOptions options);

  // Null: nobody can join this server: only this PC can reach it, or its certificates are made
  // elsewhere.
  IdentityAuthority* authority() { return authority_.get(); }
  // Serves from here on. `grpc_port` is named in join strings. The errors of HttpServer.
  absl::Status Start(int grpc_port, WebServerParts parts);
  int port() const { return port_; }
  // Where a browser on this PC finds it: "http://127.0.0.1:7421/".
  std::string LocalUrl() const;
  HttpStats Stats() const { return http_ == nullptr ? HttpStats() : http_->Stats(); }
  void Shutdown();

 private:
  WebServer(WebServerOptions options, bool tls, std::unique_ptr<IdentityAuthority> authority);

  HttpServerOptions HttpOptions(const std::string& address);
  std::vector<HttpRoute> Routes(const WebServerParts& parts);
  absl::Status Listen(const WebServerParts& parts);
  // Follows the addresses of this PC.
  void Refresh();
  void TellAddresses();
  bool IsOwnHost(const std::string& host);

  const WebServerOptions options_;
  const bool tls_;
  const std::unique_ptr<IdentityAuthority> authority_;
  uint16_t grpc_port_ = 0;
  int port_ = 0;
  std::mutex mutex_;
  std::set<std::string> hosts_;       // lower case
  std::unique_ptr<HttpServer> http_;  // its threads use the members above
};

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/audit/audit_log.h"
#include "server/http/http_server.h"
#include "server/identity/identity_authority.h"

namespace rigcal::server {

struct EnrolmentServerOptions {
  std::filesystem::path data_dir;
  std::string grpc_listen;    // HOST:PORT
  std::string https_listen;   // HOST:PORT; empty: the host of grpc_listen, port 7421
  AuditLog* audit = nullptr;  // who joined and who was refused; null: nothing is written
  // Whether the server takes data, for /readyz.
  std::function<absl::Status()> ready = [] { return absl::OkStatus(); };
};

// What the server's certificate is for: where others reach the two addresses (HOST:PORT; the second
// may be empty).
std::vector<std::string> CertificateHosts(const std::string& grpc_listen,
                                          const std::string& https_listen);

// Lets other PCs join: the server's identity, and the HTTPS port where they ask for theirs.
class EnrolmentServer {
 public:
  // Null: the server listens on this PC only, and HTTPS is not configured; or its certificates are
  // made elsewhere. Makes the identity where
  // it is missing, with the errors of EnsureServerIdentity and IdentityAuthority::Open.
  static absl::StatusOr<std::unique_ptr<EnrolmentServer>> Open(EnrolmentServerOptions options);

  IdentityAuthority* authority() { return authority_.get(); }
  // Serves HTTPS from here on. `grpc_port` is named in join strings. The errors of HttpServer.
  absl::Status Start(int grpc_port);
  int https_port() const { return https_port_; }
  void Shutdown() { http_.Shutdown(); }

 private:
  EnrolmentServer(EnrolmentServerOptions options, std::unique_ptr<IdentityAuthority> authority);

  // Follows the addresses of this PC.
  void Refresh();
  void TellAddresses();

  const EnrolmentServerOptions options_;
  const std::unique_ptr<IdentityAuthority> authority_;
  uint16_t grpc_port_ = 0;
  int https_port_ = 0;
  HttpServer http_;  // its thread uses the members above
};

}  // namespace rigcal::server

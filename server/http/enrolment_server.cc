// SPDX-License-Identifier: Apache-2.0
#include "server/http/enrolment_server.h"

#include <spdlog/spdlog.h>

#include <utility>

#include "absl/strings/str_cat.h"
#include "common/identity/join_string.h"
#include "common/status/status_macros.h"
#include "server/http/identity_routes.h"
#include "server/identity/server_identity.h"

namespace rigcal::server {
namespace {

constexpr uint16_t kHttpsPort = 7421;

std::string HostOf(const std::string& address) {
  std::string host;
  uint16_t port = 0;
  return SplitHostPort(address, &host, &port) ? host : "";
}

// Where HTTPS listens; empty: nowhere.
std::string HttpsAddress(const EnrolmentServerOptions& options) {
  if (!options.https_listen.empty()) return options.https_listen;
  const std::string host = HostOf(options.grpc_listen);
  return host.empty() || IsLoopbackHost(host) ? "" : JoinHostPort(host, kHttpsPort);
}

HttpServerOptions HttpOptions(const EnrolmentServerOptions& options,
                              std::function<void()> refresh) {
  const std::filesystem::path folder = IdentityDirectory(options.data_dir);
  return {.listen_address = HttpsAddress(options),
          .certificate_file = folder / "server.crt",
          .key_file = folder / "server.key",
          .refresh = std::move(refresh)};
}

}  // namespace

std::vector<std::string> CertificateHosts(const std::string& grpc_listen,
                                          const std::string& https_listen) {
  std::vector<std::string> hosts = ReachableHosts(HostOf(grpc_listen));
  if (https_listen.empty()) return hosts;
  for (std::string& host : ReachableHosts(HostOf(https_listen))) hosts.push_back(std::move(host));
  return hosts;
}

absl::StatusOr<std::unique_ptr<EnrolmentServer>> EnrolmentServer::Open(
    EnrolmentServerOptions options) {
  if (HttpsAddress(options).empty()) return nullptr;
  RIGCAL_RETURN_IF_ERROR(EnsureServerIdentity(
      options.data_dir, CertificateHosts(options.grpc_listen, options.https_listen)));
  if (HasForeignCa(IdentityDirectory(options.data_dir))) {
    spdlog::warn(
        "nobody can join this server: {} has no ca.key, so its certificates are made "
        "elsewhere",
        IdentityDirectory(options.data_dir).string());
    return nullptr;
  }
  RIGCAL_ASSIGN_OR_RETURN(auto authority,
                          IdentityAuthority::Open(IdentityDirectory(options.data_dir)));
  return std::unique_ptr<EnrolmentServer>(
      new EnrolmentServer(std::move(options), std::move(authority)));
}

EnrolmentServer::EnrolmentServer(EnrolmentServerOptions options,
                                 std::unique_ptr<IdentityAuthority> authority)
    : options_(std::move(options)),
      authority_(std::move(authority)),
      http_(HttpOptions(options_, [this] { Refresh(); }),
            IdentityRoutes(authority_.get(), options_.audit, options_.ready)) {}

absl::Status EnrolmentServer::Start(int grpc_port) {
  grpc_port_ = static_cast<uint16_t>(grpc_port);
  RIGCAL_ASSIGN_OR_RETURN(https_port_, http_.Start());
  TellAddresses();
  return absl::OkStatus();
}

void EnrolmentServer::TellAddresses() {
  authority_->SetAddresses({.hosts = ReachableHosts(HostOf(options_.grpc_listen)),
                            .grpc_port = grpc_port_,
                            .https_port = static_cast<uint16_t>(https_port_)});
}

void EnrolmentServer::Refresh() {
  const absl::Status status = EnsureServerIdentity(
      options_.data_dir, CertificateHosts(options_.grpc_listen, options_.https_listen));
  if (!status.ok()) {
    spdlog::error("the server's certificate was not renewed: {}", std::string(status.message()));
  }
  TellAddresses();
}

}  // namespace rigcal::server

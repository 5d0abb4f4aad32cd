// SPDX-License-Identifier: Apache-2.0
#include "server/http/web_server.h"

#include <spdlog/spdlog.h>

#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "common/identity/join_string.h"
#include "common/status/status_macros.h"
#include "server/http/api_handler.h"
#include "server/http/asset_routes.h"
#include "server/http/docs_routes.h"
#include "server/http/identity_routes.h"
#include "server/http/login_routes.h"
#include "server/identity/server_identity.h"

namespace rigcal::server {
namespace {

constexpr uint16_t kWebPort = 7421;  // where the one behind gRPC's cannot be
constexpr char kStatusRpc[] = "/rigcal.v1.StatusService/GetStatus";

std::string HostOf(const std::string& address) {
  std::string host;
  uint16_t port = 0;
  return SplitHostPort(address, &host, &port) ? host : "";
}

// The port behind that of gRPC, so that --listen moves both; any free one where that is any.
std::string WebAddress(const WebServerOptions& options) {
  if (!options.https_listen.empty()) return options.https_listen;
  std::string host;
  uint16_t port = 0;
  constexpr uint16_t kLastPort = 65535;
  if (!SplitHostPort(options.grpc_listen, &host, &port)) return JoinHostPort("", kWebPort);
  if (port == kLastPort) return JoinHostPort(host, kWebPort);
  return JoinHostPort(host, port == 0 ? uint16_t{0} : static_cast<uint16_t>(port + 1));
}

// Others can reach one of the ports or are meant to join, or this machine itself must sign in.
bool NeedsTls(const WebServerOptions& options) {
  return !options.https_listen.empty() || !options.plain_loopback ||
         !IsLoopbackHost(HostOf(options.grpc_listen));
}

}  // namespace

std::vector<std::string> CertificateHosts(const std::string& advertised,
                                          const std::string& grpc_listen,
                                          const std::string& https_listen) {
  std::vector<std::string> hosts = ReachableHosts(HostOf(grpc_listen));
  if (!advertised.empty()) hosts.insert(hosts.begin(), HostOf(advertised));
  if (https_listen.empty()) return hosts;
  for (std::string& host : ReachableHosts(HostOf(https_listen))) hosts.push_back(std::move(host));
  return hosts;
}

absl::StatusOr<std::unique_ptr<WebServer>> WebServer::Open(WebServerOptions options) {
  std::unique_ptr<IdentityAuthority> authority;
  const bool tls = NeedsTls(options);
  if (tls) {
    RIGCAL_RETURN_IF_ERROR(EnsureServerIdentity(
        options.data_dir,
        CertificateHosts(options.advertised, options.grpc_listen, options.https_listen)));
    if (options.waiting) {
      // Its files are those of the other server.
    } else if (HasForeignCa(IdentityDirectory(options.data_dir))) {
      spdlog::warn(
          "nobody can join this server: {} has no ca.key, so its certificates are made elsewhere",
          IdentityDirectory(options.data_dir).string());
    } else {
      RIGCAL_ASSIGN_OR_RETURN(authority,
                              IdentityAuthority::Open(IdentityDirectory(options.data_dir)));
    }
  }
  return std::unique_ptr<WebServer>(new WebServer(std::move(options), tls, std::move(authority)));
}

WebServer::WebServer(WebServerOptions options, bool tls,
                     std::unique_ptr<IdentityAuthority> authority)
    : options_(std::move(options)), tls_(tls), authority_(std::move(authority)) {}

HttpServerOptions WebServer::HttpOptions(const std::string& address) {
  HttpServerOptions http{.listen_address = address,
                         .certificate_file = {},
                         .key_file = {},
                         .plain_loopback = options_.plain_loopback,
                         .refresh = [this] { Refresh(); }};
  if (tls_) {
    const std::filesystem::path folder = IdentityDirectory(options_.data_dir);
    http.certificate_file = folder / "server.crt";
    http.key_file = folder / "server.key";
  }
  return http;
}

std::vector<HttpRoute> WebServer::Routes(const WebServerParts& parts) {
  if (options_.waiting) return WaitingRoutes(options_.waiting);
  using For = HttpRoute::For;
  std::vector<HttpRoute> routes = IdentityRoutes(authority_.get(), options_.audit, options_.ready);
  const auto add = [&routes](std::vector<HttpRoute> more) {
    for (HttpRoute& route : more) routes.push_back(std::move(route));
  };
  add(LoginRoutes(authority_.get(), options_.audit));
  add({{.method = "GET",
        .path = "/v1/openapi.json",
        .handle =
            [text = parts.api_description](const HttpRequest&) {
              return HttpResponse{.content_type = "application/json", .body = text};
            },
        .who = For::kSignedIn},
       {.method = "GET",
        .path = "/metrics",
        .begin =
            [gateway = parts.gateway, metrics = parts.metrics](
                const HttpRequest& request, const std::function<void(HttpWork)>& done) {
              done([gateway, metrics, caller = request.caller] {
                const absl::Status status = gateway->Check(caller, kStatusRpc);
                if (!status.ok()) return ErrorResponse(status);
                return HttpResponse{.content_type = "text/plain; version=0.0.4; charset=utf-8",
                                    .body = metrics()};
              });
            },
        .who = For::kSignedIn}});
  add(AssetRoutes(BuiltInAssets()));
  add(DocsRoutes(options_.docs_dir.empty() ? DefaultDocsFolder() : options_.docs_dir));
  add(ApiHttpRoutes(parts.gateway));
  return routes;
}

absl::Status WebServer::Listen(const WebServerParts& parts) {
  const HttpRouter router(
      Routes(parts),
      {.is_own_host = [this](const std::string& host) { return IsOwnHost(host); },
       .identify =
           [this](const HttpRequest& request) { return CallerOf(authority_.get(), request); }});
  const std::string address = WebAddress(options_);
  http_ = std::make_unique<HttpServer>(HttpOptions(address), router);
  absl::StatusOr<int> port = http_->Start();
  const bool any_will_do = options_.https_listen.empty() && IsLoopbackHost(HostOf(address));
  if (absl::IsUnavailable(port.status()) && any_will_do) {
    spdlog::warn("{} is in use; the dashboard and the JSON API get another port", address);
    http_ = std::make_unique<HttpServer>(HttpOptions(JoinHostPort(HostOf(address), 0)), router);
    port = http_->Start();
  }
  if (!port.ok()) return port.status();
  port_ = *port;
  return absl::OkStatus();
}

absl::Status WebServer::Start(int grpc_port, WebServerParts parts) {
  grpc_port_ = static_cast<uint16_t>(grpc_port);
  TellAddresses();
  RIGCAL_RETURN_IF_ERROR(Listen(parts));
  TellAddresses();
  return absl::OkStatus();
}

void WebServer::Shutdown() {
  if (http_ != nullptr) http_->Shutdown();
}

std::string WebServer::LocalUrl() const {
  std::string host = HostOf(WebAddress(options_));
  if (host == "0.0.0.0") host = "127.0.0.1";
  if (host == "::") host = "::1";
  const bool plain = IsLoopbackHost(host) && options_.plain_loopback;
  return absl::StrCat(plain ? "http://" : "https://",
                      JoinHostPort(host, static_cast<uint16_t>(port_)), "/");
}

bool WebServer::IsOwnHost(const std::string& host) {
  const std::lock_guard lock(mutex_);
  return hosts_.contains(host);
}

void WebServer::TellAddresses() {
  std::set<std::string> hosts;
  for (const std::string& host :
       CertificateHosts(options_.advertised, options_.grpc_listen, WebAddress(options_))) {
    hosts.insert(absl::AsciiStrToLower(host));
  }
  for (const std::string& host : options_.hosts) hosts.insert(absl::AsciiStrToLower(host));
  {
    const std::lock_guard lock(mutex_);
    hosts_ = std::move(hosts);
  }
  if (authority_ == nullptr) return;
  std::vector<std::string> reachable = ReachableHosts(HostOf(options_.grpc_listen));
  if (!options_.advertised.empty())
    reachable.insert(reachable.begin(), HostOf(options_.advertised));
  authority_->SetAddresses({.hosts = std::move(reachable),
                            .grpc_port = grpc_port_,
                            .https_port = static_cast<uint16_t>(port_)});
}

void WebServer::Refresh() {
  if (tls_) {
    const absl::Status status = EnsureServerIdentity(
        options_.data_dir,
        CertificateHosts(options_.advertised, options_.grpc_listen, options_.https_listen));
    if (!status.ok()) {
      spdlog::error("the server's certificate was not renewed: {}", std::string(status.message()));
    }
  }
  TellAddresses();
}

}  // namespace rigcal::server

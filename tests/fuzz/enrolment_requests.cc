// SPDX-License-Identifier: Apache-2.0
// The bodies that anybody may send to the routes for joining. The first byte, modulo 3: /v1/enrol
// (0), /v1/renew (1), /v1/login (2).
//
// Stand for what is another one in each run: @SECRET@ the secret of a fresh join string for agents,
// @JOIN@ a fresh join string for operators, @CSR@ a request for a certificate, @CERT@ a certificate
// of the server for the same key, @OLD@ one that is due, @CA@ the server's own; PEM as in JSON.
#include <spdlog/spdlog.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_replace.h"
#include "common/enrolment/enrolment_answers.h"
#include "common/identity/certificate_request.h"
#include "common/identity/private_key.h"
#include "server/http/identity_routes.h"
#include "server/http/login_routes.h"
#include "server/identity/server_identity.h"
#include "tests/fuzz/fuzz_check.h"
#include "tests/fuzz/fuzz_folder.h"

namespace {

using ::rigcal::server::HttpResponse;

constexpr int kInputsOfAServer = 4096;  // its files grow with each that joins

std::string InJson(const std::string& pem) { return absl::StrReplaceAll(pem, {{"\n", "\\n"}}); }

// A server's routes, and somebody with a key.
class Server {
 public:
  Server() {
    spdlog::set_level(spdlog::level::off);
    FUZZ_CHECK(rigcal::server::EnsureServerIdentity(folder_.path(), {"server"}).ok());
    const auto identity = rigcal::server::IdentityDirectory(folder_.path());
    auto opened = rigcal::server::IdentityAuthority::Open(identity);
    const auto ca = rigcal::server::CertificateAuthority::Open(identity);
    const auto key = rigcal::MakePrivateKey();
    FUZZ_CHECK(opened.ok() && ca.ok() && key.ok());
    authority_ = *std::move(opened);
    authority_->SetAddresses({.hosts = {"server"}, .grpc_port = 7420, .https_port = 7421});
    const std::string csr = *rigcal::MakeCertificateRequest(*key, "pc-1", rigcal::Role::kAgent);
    const rigcal::server::CertificateAuthority::PeerRequest peer = {
        rigcal::Role::kAgent, "pc-1", rigcal::ParseCertificateRequest(csr)->public_key};
    peer_ = {.ca_pem = ca->pem(), .certificate_pem = "", .key_pem = *key, .grpc = {}, .https = {}};
    words_ = {{"@CSR@", InJson(csr)},
              {"@CERT@", InJson(*ca->IssuePeer(peer, absl::Now()))},
              {"@OLD@", InJson(*ca->IssuePeer(peer, absl::Now() - absl::Hours(24 * 25)))},
              {"@CA@", InJson(ca->pem())}};
    routes_ =
        rigcal::server::IdentityRoutes(authority_.get(), nullptr, [] { return absl::OkStatus(); });
    for (auto& route : rigcal::server::LoginRoutes(authority_.get(), nullptr)) {
      routes_.push_back(std::move(route));
    }
  }

  void Send(const std::string& path, std::string body) {
    Offer("@SECRET@", &agent_, &body);
    Offer("@JOIN@", &operator_, &body);
    absl::StrReplaceAll(words_, &body);
    for (const rigcal::server::HttpRoute& route : routes_) {
      if (route.method != "POST" || route.path != path || body.size() > route.max_body_bytes) {
        continue;
      }
      rigcal::server::HttpRequest request{.peer = "10.0.0.6"};
      request.body = body;
      const HttpResponse response = route.handle(request);
      Check(path, response);
      if (response.status == 200 && path == "/v1/enrol") Revoke(&agent_);
      if (response.status == 200 && path == "/v1/login") Revoke(&operator_);
    }
  }

 private:
  void Check(const std::string& path, const HttpResponse& response) const {
    static const std::set<unsigned> documented = {200, 400, 401, 403, 409};
    FUZZ_CHECK(documented.count(response.status) == 1);
    FUZZ_CHECK(nlohmann::json::parse(response.body, nullptr, false).is_object());
    if (path == "/v1/login" || response.status != 200) return;
    // Whoever gets a certificate can use it.
    rigcal::PeerIdentity joined = peer_;
    FUZZ_CHECK(rigcal::ReadIssued("server:7421",
                                  {.status = 200, .body = response.body, .server_time = {}},
                                  &joined)
                   .ok());
  }

  // A join string that nobody has used. Making one writes to the disk.
  struct Token {
    rigcal::Role role;
    std::string id = {};  // empty: there is none
    std::string text = {};
  };

  // Puts it in the place of the word, if that is there.
  void Offer(const char* word, Token* token, std::string* body) {
    if (!absl::StrContains(*body, word)) return;
    if (token->id.empty()) {
      const auto made = authority_->CreateToken(token->role, absl::Hours(1), "");
      FUZZ_CHECK(made.ok());
      token->id = made->token.id;
      token->text =
          token->role == rigcal::Role::kOperator
              ? made->join_string
              : absl::WebSafeBase64Escape(rigcal::ParseJoinString(made->join_string)->secret);
    }
    absl::StrReplaceAll({{word, token->text}}, body);
  }
  // With who has used it, so that the name is free again.
  void Revoke(Token* token) {
    FUZZ_CHECK(authority_->RevokeToken(token->id).ok());
    token->id.clear();
  }

  rigcal::testing::FuzzFolder folder_;
  Token agent_{rigcal::Role::kAgent};
  Token operator_{rigcal::Role::kOperator};
  std::unique_ptr<rigcal::server::IdentityAuthority> authority_;
  std::vector<rigcal::server::HttpRoute> routes_;
  rigcal::PeerIdentity peer_;
  std::vector<std::pair<std::string, std::string>> words_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static std::unique_ptr<Server> server;
  static int inputs = 0;
  if (size == 0) return 0;
  if (inputs++ % kInputsOfAServer == 0) {
    server.reset();
    server = std::make_unique<Server>();
  }
  const char* const paths[] = {"/v1/enrol", "/v1/renew", "/v1/login"};
  server->Send(paths[data[0] % 3], std::string(reinterpret_cast<const char*>(data) + 1, size - 1));
  return 0;
}

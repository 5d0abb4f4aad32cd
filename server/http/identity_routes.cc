// SPDX-License-Identifier: Apache-2.0
#include "server/http/identity_routes.h"

#include <spdlog/spdlog.h>

#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "common/identity/certificate.h"
#include "common/status/status_macros.h"
#include "common/text/nesting.h"

namespace rigcal::server {
namespace {

using RouteJson = nlohmann::ordered_json;

HttpResponse JsonResponse(unsigned status, const RouteJson& json) {
  return {.status = status,
          .content_type = "application/json",
          .body = json.dump(-1, ' ', false, RouteJson::error_handler_t::replace) + "\n"};
}

// Two texts of a JSON object. INVALID_ARGUMENT: it is none, or lacks one of them.
absl::Status ReadTwoTexts(const std::string& body, const char* first_key, std::string* first,
                          const char* second_key, std::string* second) {
  const auto json = ParseJson<RouteJson>(body);
  for (const auto& [key, text] : {std::pair{first_key, first}, {second_key, second}}) {
    if (!json.is_object() || !json.contains(key) || !json[key].is_string()) {
      return absl::InvalidArgumentError(
          absl::StrCat("the body must be a JSON object with the texts \"", first_key, "\" and \"",
                       second_key, "\""));
    }
    *text = json[key].get<std::string>();
  }
  return absl::OkStatus();
}

using Issued = absl::StatusOr<IdentityAuthority::Issued>;

Issued Enrol(IdentityAuthority* authority, const std::string& body) {
  std::string secret_text, csr, secret;
  RIGCAL_RETURN_IF_ERROR(ReadTwoTexts(body, "secret", &secret_text, "csr", &csr));
  if (!absl::WebSafeBase64Unescape(secret_text, &secret)) {
    return absl::InvalidArgumentError("\"secret\" is not base64url");
  }
  return authority->Enrol(secret, csr);
}

// `is_new` is false where it is too early: the answer holds the old certificate.
Issued Renew(IdentityAuthority* authority, const std::string& body, bool* is_new) {
  std::string certificate, csr;
  RIGCAL_RETURN_IF_ERROR(ReadTwoTexts(body, "certificate", &certificate, "csr", &csr));
  Issued issued = authority->Renew(certificate, csr);
  *is_new = issued.ok() && issued->certificate_pem != certificate;
  return issued;
}

// Answers, and puts into the audit log who got a certificate, or why not.
HttpResponse Certificates(const char* event, const HttpRequest& request, const Issued& issued,
                          AuditLog* audit) {
  if (!issued.ok()) {
    const std::string message(issued.status().message());
    // Anybody may ask: the audit log limits its lines for each peer.
    spdlog::debug("{} from {} is refused: {}", event, request.peer, message);
    if (audit != nullptr) {
      audit->Write(
          absl::StrCat(event, "_refused"), request.peer,
          {{"code", absl::StatusCodeToString(issued.status().code())}, {"message", message}});
    }
    return ErrorResponse(issued.status());
  }
  const absl::StatusOr<Certificate> certificate = ParseCertificate(issued->certificate_pem);
  if (audit != nullptr && certificate.ok()) {
    audit->Write(event, request.peer, {{"uri", certificate->uri}, {"serial", certificate->serial}});
  }
  return JsonResponse(200, {{"certificate", issued->certificate_pem},
                            {"ca", issued->ca_pem},
                            {"grpc", issued->grpc},
                            {"https", issued->https}});
}

}  // namespace

std::vector<HttpRoute> IdentityRoutes(IdentityAuthority* authority, AuditLog* audit,
                                      std::function<absl::Status()> ready) {
  std::vector<HttpRoute> routes = {
      {"GET", "/healthz", [](const HttpRequest&) { return HttpResponse{.body = "ok\n"}; }},
      {"GET", "/readyz", [ready = std::move(ready)](const HttpRequest&) {
         const absl::Status status = ready();
         if (status.ok()) return HttpResponse{.body = "ready\n"};
         return HttpResponse{.status = 503, .body = std::string(status.message()) + "\n"};
       }}};
  if (authority == nullptr) return routes;
  routes.push_back({"GET", "/v1/ca", [authority](const HttpRequest&) {
                      return HttpResponse{.content_type = "application/x-pem-file",
                                          .body = authority->ca_pem()};
                    }});
  routes.push_back({"POST", "/v1/enrol", [authority, audit](const HttpRequest& request) {
                      return Certificates("enrol", request, Enrol(authority, request.body), audit);
                    }});
  routes.push_back({"POST", "/v1/renew", [authority, audit](const HttpRequest& request) {
                      bool is_new = false;
                      const Issued issued = Renew(authority, request.body, &is_new);
                      return Certificates("renew", request, issued,
                                          is_new || !issued.ok() ? audit : nullptr);
                    }});
  return routes;
}

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#include "server/http/login_routes.h"

#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "common/identity/private_key.h"
#include "common/status/status_macros.h"
#include "common/text/nesting.h"

namespace rigcal::server {
namespace {

using LoginJson = nlohmann::ordered_json;

constexpr size_t kMaxLoginBytes = 8192;

// Of this server alone: browsers do not tell apart the cookies of two ports of one host. "__Host-":
// taken by browsers over TLS only, and sent to this host only.
std::string CookieName(const IdentityAuthority& authority) {
  return "__Host-rigcal-" + absl::BytesToHexString(Sha256(authority.ca_pem()).substr(0, 4));
}

std::string SecretOf(const IdentityAuthority& authority, const HttpRequest& request) {
  absl::string_view authorization = request.authorization;
  if (absl::ConsumePrefix(&authorization, "Bearer ")) return std::string(authorization);
  const std::string name = CookieName(authority) + "=";
  for (absl::string_view part : absl::StrSplit(request.cookie, ';')) {
    part = absl::StripAsciiWhitespace(part);
    if (absl::ConsumePrefix(&part, name)) return std::string(part);
  }
  return "";
}

HttpResponse Json(const LoginJson& json) {
  return {.content_type = "application/json", .body = json.dump() + "\n"};
}

std::string CookieOf(const IdentityAuthority& authority, const std::string& secret,
                     absl::Duration life) {
  return absl::StrCat(CookieName(authority), "=", secret, "; Path=/; Secure; HttpOnly; ",
                      "SameSite=Strict; Max-Age=", absl::ToInt64Seconds(life));
}

absl::StatusOr<std::string> TokenOf(const std::string& body) {
  const auto json = ParseJson<LoginJson>(body);
  if (json.is_object() && json.contains("token") && json["token"].is_string()) {
    return json["token"].get<std::string>();
  }
  return absl::InvalidArgumentError(
      "the body must be a JSON object with the text \"token\": a join string (rk1...)");
}

HttpResponse SignIn(IdentityAuthority* authority, AuditLog* audit, const HttpRequest& request) {
  if (request.local) {
    return ErrorResponse(absl::FailedPreconditionError(
        "on the server's own PC nobody needs to sign in; open the page without the token, or use "
        "the token on another PC"));
  }
  if (authority == nullptr) {
    return ErrorResponse(absl::FailedPreconditionError(
        "nobody can sign in here: this server's certificates are made elsewhere"));
  }
  const absl::StatusOr<std::string> token = TokenOf(request.body);
  if (!token.ok()) return ErrorResponse(token.status());
  const absl::StatusOr<IdentityAuthority::WebLogin> login = authority->SignIn(*token);
  if (!login.ok()) {
    if (audit != nullptr) {
      audit->Write("login_refused", request.peer,
                   {{"code", absl::StatusCodeToString(login.status().code())},
                    {"message", std::string(login.status().message())}});
    }
    return ErrorResponse(login.status());
  }
  const WebSession& session = login->session;
  if (audit != nullptr) {
    audit->Write("login", request.peer,
                 {{"uri", PeerUri(session.role, session.name)}, {"token", session.token_id}});
  }
  HttpResponse response =
      Json({{"name", session.name},
            {"role", RoleName(session.role)},
            {"expire_time",
             absl::FormatTime("%Y-%m-%dT%H:%M:%SZ", session.expires, absl::UTCTimeZone())}});
  response.headers.emplace_back("Set-Cookie",
                                CookieOf(*authority, login->secret, kWebSessionLifetime));
  return response;
}

HttpResponse SignOut(IdentityAuthority* authority, const HttpRequest& request) {
  HttpResponse response = Json(LoginJson::object());
  if (authority == nullptr || request.local) return response;
  const absl::Status status = authority->SignOut(SecretOf(*authority, request));
  if (!status.ok()) return ErrorResponse(status);
  response.headers.emplace_back("Set-Cookie", CookieOf(*authority, "", absl::ZeroDuration()));
  return response;
}

}  // namespace

absl::StatusOr<Peer> CallerOf(const IdentityAuthority* authority, const HttpRequest& request) {
  if (request.local) return Peer();
  if (authority == nullptr) {
    return absl::UnauthenticatedError(
        "nobody can sign in here: this server's certificates are made elsewhere; use it from its "
        "own PC");
  }
  const std::string secret = SecretOf(*authority, request);
  if (secret.empty()) {
    return absl::UnauthenticatedError(
        "sign in first: rigcal token create --role viewer (or operator) on the server's PC makes a "
        "join string for /login");
  }
  RIGCAL_ASSIGN_OR_RETURN(WebSession session, authority->FindWebSession(secret));
  Peer peer{.has_certificate = true, .role = session.role, .name = session.name};
  peer.uri = PeerUri(session.role, session.name);
  return peer;
}

std::vector<HttpRoute> LoginRoutes(IdentityAuthority* authority, AuditLog* audit) {
  return {
      {.method = "POST",
       .path = "/v1/login",
       .handle = [authority,
                  audit](const HttpRequest& request) { return SignIn(authority, audit, request); },
       .who = HttpRoute::For::kSignIn,
       .max_body_bytes = kMaxLoginBytes},
      {.method = "GET",
       .path = "/v1/login",
       .handle =
           [](const HttpRequest& request) {
             return Json({{"name", request.caller.name},
                          {"role", RoleName(request.caller.role)},
                          {"this_machine", request.local}});
           },
       .who = HttpRoute::For::kSignedIn},
      {.method = "POST",
       .path = "/v1/logout",
       .handle = [authority](const HttpRequest& request) { return SignOut(authority, request); },
       .who = HttpRoute::For::kSignIn,
       .max_body_bytes = kMaxLoginBytes}};
}

}  // namespace rigcal::server

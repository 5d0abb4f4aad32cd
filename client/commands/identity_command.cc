// SPDX-License-Identifier: Apache-2.0
#include "client/commands/identity_command.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdlib>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "client/net/server_connection.h"
#include "client/output/quantities.h"
#include "client/output/text_table.h"
#include "common/enrolment/join_server.h"
#include "common/identity/identity_folder.h"
#include "common/identity/join_string.h"
#include "common/status/validate_name.h"
#include "common/wire/time_wire.h"
#include "rigcal/v1/identity_service.grpc.pb.h"

namespace rigcal::client {
namespace {

std::string StateOf(const v1::Token& token) {
  const double now_s = absl::ToDoubleSeconds(absl::Now() - absl::UnixEpoch());
  if (token.revoked()) return "revoked";
  if (token.has_use_time()) return "used";
  return static_cast<double>(token.expire_time().seconds()) < now_s ? "expired" : "open";
}

std::string FormatTokens(const v1::ListTokensResponse& response) {
  if (response.tokens().empty()) return "no tokens\n";
  TextTable table;
  table.Words({"token", "role", "name", "state", "made", "expires", "used by"});
  for (const v1::Token& token : response.tokens()) {
    table.AddRow({token.id(), EnumWord(token.role()), token.name().empty() ? "-" : token.name(),
                  StateOf(token), FormatTime(token.has_create_time(), token.create_time()),
                  FormatTime(token.has_expire_time(), token.expire_time()),
                  token.used_by().empty() ? "-" : token.used_by()});
  }
  return table.Format();
}

// "anna-desk3", of what may be in a name.
std::string OwnName() {
  const char* const user = std::getenv("USER");
  std::array<char, 256> host{};
  if (gethostname(host.data(), host.size() - 1) != 0) host[0] = '\0';
  std::string host_name(host.data());
  host_name.resize(std::min(host_name.find('.'), host_name.size()));
  std::string name = absl::StrCat(user == nullptr || *user == '\0' ? "user" : user, "-",
                                  host_name.empty() ? "pc" : host_name);
  std::ranges::replace_if(
      name, [](char c) { return !absl::ascii_isalnum(static_cast<unsigned char>(c)) && c != '_'; },
      '-');
  return name.substr(0, 64);
}

// Where a person signs in with the string, one for each address of the server; agents nowhere.
std::vector<std::string> LoginLinks(const std::string& text) {
  std::vector<std::string> links;
  const absl::StatusOr<JoinString> join = ParseJoinString(text);
  if (!join.ok() || join->role == Role::kAgent) return links;
  for (const std::string& address : HostPorts(join->hosts, join->https_port)) {
    links.push_back(absl::StrCat("https://", address, "/login#token=", text));
  }
  return links;
}

absl::StatusOr<std::string> LoginWith(const LoginOptions& options) {
  absl::StatusOr<JoinString> join = ParseJoinString(options.join_string);
  if (!join.ok()) return join.status();
  if (join->role == Role::kAgent) {
    return absl::InvalidArgumentError(
        "the join string is for a PC with cameras; use it there with: rigcal-agent join STRING");
  }
  if (!join->name.empty() && !options.name.empty() && join->name != options.name) {
    return absl::InvalidArgumentError(
        absl::StrCat("the join string is for the user ", join->name, ", not for ", options.name));
  }
  const std::string name = !join->name.empty()     ? join->name
                           : !options.name.empty() ? options.name
                                                   : OwnName();
  if (const absl::Status valid = ValidateName("user name", name); !valid.ok()) return valid;
  const std::filesystem::path config = UserConfigFolder();
  if (config.empty()) {
    return absl::FailedPreconditionError(
        "neither XDG_CONFIG_HOME nor HOME is set: there is no folder for the identity");
  }
  const absl::StatusOr<PeerIdentity> identity = JoinServer(*join, name);
  if (!identity.ok()) return identity.status();
  const IdentityFolder folder = IdentityFolder::OfUser(config);
  if (const absl::Status status = folder.Replace(*identity); !status.ok()) return status;
  return absl::StrCat("logged in as ", name, " (", std::string(RoleName(join->role)),
                      "); the server is ", identity->grpc.empty() ? "?" : identity->grpc.front(),
                      "\nidentity in ", folder.path().string(), ", renewed by itself\n");
}

}  // namespace

ExitCode CreateToken(const CreateTokenOptions& options, CommandContext& context) {
  v1::CreateTokenRequest request;
  const std::optional<Role> role = RoleFromName(options.role);
  request.set_role(static_cast<v1::Role>(role.value_or(Role::kAgent)));
  *request.mutable_ttl() = wire::ToDuration(options.ttl_s);
  request.set_name(options.name);
  ServerConnection server(context.server);
  return context.Show(server.Call(&v1::IdentityService::Stub::CreateToken, request),
                      [&](const v1::CreateTokenResponse& made) {
                        for (const std::string& link : LoginLinks(made.join_string())) {
                          context.console.Message(absl::StrCat("in a browser: ", link));
                        }
                        return made.join_string() + "\n";
                      });
}

ExitCode ListTokens(CommandContext& context) {
  ServerConnection server(context.server);
  return context.Show(server.Call(&v1::IdentityService::Stub::ListTokens, {}), FormatTokens);
}

ExitCode RevokeToken(const std::string& id, CommandContext& context) {
  ServerConnection server(context.server);
  v1::RevokeTokenRequest request;
  request.set_id(id);
  return context.Show(server.Call(&v1::IdentityService::Stub::RevokeToken, request),
                      [&](const auto&) { return absl::StrCat("token ", id, " is revoked\n"); });
}

ExitCode ForgetAgent(const std::string& name, CommandContext& context) {
  if (const absl::Status valid = ValidateName("agent", name); !valid.ok()) {
    return context.Fail(valid);
  }
  ServerConnection server(context.server);
  v1::RevokeRequest request;
  request.set_uri(PeerUri(Role::kAgent, name));
  const auto identities = server.Call(&v1::IdentityService::Stub::ListIdentities, {});
  if (!identities.ok()) return context.Fail(identities.status());
  const bool on_record = std::ranges::any_of(
      identities->identities(),
      [&](const v1::Identity& identity) { return identity.uri() == request.uri(); });
  return context.Show(server.Call(&v1::IdentityService::Stub::Revoke, request), [&](const auto&) {
    return absl::StrCat("agent ", name,
                        on_record ? " is forgotten: its certificates are refused from now on, and "
                                    "its name and cameras are free\n"
                                  : " is not on record here; certificates of that name are refused "
                                    "from now on, should there be any\n");
  });
}

ExitCode Login(const LoginOptions& options, CommandContext& context) {
  const absl::StatusOr<std::string> text = LoginWith(options);
  if (!text.ok()) return context.Fail(text.status());
  context.console.out << *text << std::flush;
  return ExitCode::kOk;
}

}  // namespace rigcal::client

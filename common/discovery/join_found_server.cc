// SPDX-License-Identifier: Apache-2.0
#include "common/discovery/join_found_server.h"

#include <algorithm>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/strip.h"
#include "common/enrolment/join_server.h"
#include "common/status/status_macros.h"
#include "common/text/printable.h"

namespace rigcal {
namespace {

constexpr char kHowToGetAString[] =
    "`rigcal token create` on the server's PC prints a join string; use it here: "
    "rigcal-agent join STRING";

// "  1  vm  192.168.77.10:7421", a line for each.
std::string ListOf(const std::vector<FoundServer>& servers) {
  std::string text;
  for (size_t i = 0; i < servers.size(); ++i) {
    const FoundServer& server = servers[i];
    absl::StrAppend(&text, "  ", i + 1, "  ", Printable(server.name), "  ",
                    absl::StrJoin(HostPorts(server.hosts, server.https_port), ", "), "\n");
  }
  return text;
}

// Why there is no list, if there is none.
std::string Found(const absl::StatusOr<std::vector<FoundServer>>& servers) {
  if (!servers.ok()) {
    return absl::StrCat(
        "cannot look for servers in this network: ", std::string(servers.status().message()), "\n");
  }
  if (servers->empty()) {
    return "no server announces itself in this network (on the server: mdns = true in "
           "[discovery] of server.toml)\n";
  }
  return absl::StrCat("servers that announce themselves in this network:\n", ListOf(*servers));
}

// What is typed on one line; empty: nothing, or there is nobody.
std::string Ask(const Dialog& dialog, const char* question) {
  if (dialog.in == nullptr) return "";
  dialog.out << question << std::flush;
  std::string line;
  std::getline(*dialog.in, line);
  return std::string(absl::StripAsciiWhitespace(line));
}

}  // namespace

absl::StatusOr<std::string> AskForJoinString(Discovery* discovery, const Dialog& dialog) {
  dialog.out << Found(discovery->Find(kFindPatience));
  std::string text = Ask(dialog, "join string of the server: ");
  if (!text.empty()) return text;
  return absl::InvalidArgumentError(absl::StrCat("no join string: ", kHowToGetAString));
}

absl::StatusOr<PeerIdentity> JoinFoundServer(const JoinString& join, const std::string& name,
                                             Discovery* discovery, const Dialog& dialog,
                                             std::chrono::milliseconds timeout) {
  absl::StatusOr<PeerIdentity> identity = JoinServer(join, name, timeout);
  if (!absl::IsUnavailable(identity.status())) return identity;
  const std::string unreachable(identity.status().message());
  const auto servers = discovery->Find(kFindPatience);
  const std::string list = Found(servers);
  if (!servers.ok() || servers->empty() || dialog.in == nullptr) {
    return absl::UnavailableError(
        absl::StrCat(unreachable, "\n", list,
                     "a server at another address than the join string says is joined with: "
                     "rigcal-agent join STRING --server HOST:PORT (its HTTPS port)"));
  }
  dialog.out << unreachable << "\n" << list;
  size_t number = 0;
  if (!absl::SimpleAtoi(Ask(dialog, "number of the server to join: "), &number) || number == 0 ||
      number > servers->size()) {
    return absl::UnavailableError("no server was chosen, and nothing was joined");
  }
  JoinString elsewhere = join;
  elsewhere.hosts = (*servers)[number - 1].hosts;
  elsewhere.https_port = (*servers)[number - 1].https_port;
  return JoinServer(elsewhere, name, timeout);
}

}  // namespace rigcal

// SPDX-License-Identifier: Apache-2.0
#include "server/turn/wait_for_turn.h"

#include <spdlog/spdlog.h>
#include <time.h>

#include <string>

#include "absl/strings/str_cat.h"
#include "common/service/service_notice.h"
#include "common/status/status_macros.h"

namespace rigcal::server {
namespace {

constexpr timespec kTurnInterval{.tv_sec = 0, .tv_nsec = 200'000'000};

std::string NameOf(const ServerEntry& server) {
  if (server.address.empty()) return "another rigcal-server, or a command of it,";
  return absl::StrCat("the server at ", server.address, " (PC ", server.host, ")");
}

Refusal RefusalFor(const std::optional<ServerEntry>& active) {
  if (!active) {
    return {.message = "it takes over by itself, now; try again in a moment", .active_server = ""};
  }
  return {.message = absl::StrCat(
              "it waits, and ", NameOf(*active),
              " answers; it takes over by itself when that one ends. Name both with a comma "
              "between (--server A,B)"),
          .active_server = active->address};
}

}  // namespace

absl::StatusOr<WaitEnd> WaitForTurn(
    ServerRoster* roster, SharedFiles* files, const sigset_t& signals,
    const std::function<absl::StatusOr<WaitingPorts>(const Refusal&)>& open) {
  WaitingPorts ports;
  std::string told;  // what the log has said
  for (bool first = true;; first = false) {
    const absl::StatusOr<ServerRoster::Turn> turn = roster->LookAtTurn();
    if (!turn.ok() && first) return turn.status();
    if (turn.ok() && !turn->holder) {
      RIGCAL_RETURN_IF_ERROR(files->Fetch().status());
      return WaitEnd{.silent_owner = turn->silent_owner};
    }
    const Refusal refusal = RefusalFor(turn.ok() ? turn->holder : std::nullopt);
    const std::string news =
        turn.ok() ? absl::StrCat("this server waits: ", NameOf(*turn->holder),
                                 " answers; this one takes over when that one ends")
                  : absl::StrCat("this server waits: ", std::string(turn.status().message()));
    if (news != told) spdlog::info("{}", news);
    told = news;
    absl::StatusOr<bool> shared = files->Fetch();
    if (!shared.ok() && absl::IsFailedPrecondition(shared.status())) return shared.status();
    if (ports.rpc == nullptr && shared.value_or(false)) {
      RIGCAL_ASSIGN_OR_RETURN(ports, open(refusal));
      TellReady(news);
    }
    if (ports.rpc != nullptr) {
      ports.rpc->SetRefusal(refusal);
      ports.rpc->FollowIdentity();
    }
    const int signal = sigtimedwait(&signals, nullptr, &kTurnInterval);
    if (signal > 0) return WaitEnd{.signal = signal};
  }
}

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <istream>
#include <ostream>
#include <string>

#include "absl/status/statusor.h"
#include "common/discovery/discovery.h"
#include "common/identity/identity_folder.h"
#include "common/identity/join_string.h"

namespace rigcal {

// Where lists are shown, and who answers questions.
struct Dialog {
  std::ostream& out;
  std::istream* in = nullptr;  // a terminal; null: there is nobody to ask
};

inline constexpr std::chrono::milliseconds kFindPatience{3000};

// The join string that somebody types, after a list of the servers that announce themselves.
// INVALID_ARGUMENT: nobody is there, or nothing is typed; the message says what to do.
absl::StatusOr<std::string> AskForJoinString(Discovery* discovery, const Dialog& dialog);

// JoinServer; and where the addresses in the join string do not answer, again at a server that
// announces itself, after asking which. The hash of the CA in the string decides as before.
// UNAVAILABLE: also where nobody is there to be asked: then the message lists the servers and says
// what to do.
absl::StatusOr<PeerIdentity> JoinFoundServer(
    const JoinString& join, const std::string& name, Discovery* discovery, const Dialog& dialog,
    std::chrono::milliseconds timeout = std::chrono::milliseconds(10'000));

}  // namespace rigcal

// SPDX-License-Identifier: Apache-2.0
#include "client/net/user_identity.h"

#include <algorithm>
#include <chrono>
#include <string>
#include <vector>

#include "absl/strings/str_split.h"
#include "common/enrolment/connection_refusal.h"
#include "common/enrolment/join_server.h"
#include "common/identity/identity_folder.h"

namespace rigcal::client {
namespace {

// A command must not wait for long for what can be done by the next one.
constexpr std::chrono::milliseconds kRenewalTimeout{2000};

}  // namespace

wire::ClientIdentity RenewedUserIdentity(const std::string& servers) {
  const wire::ClientIdentity files = wire::ClientIdentity::OfUser();
  if (!files.Exists()) return files;
  const IdentityFolder folder = IdentityFolder::OfUser(UserConfigFolder());
  const absl::StatusOr<PeerIdentity> identity = folder.Load();
  const std::vector<std::string> addresses = absl::StrSplit(servers, ',');
  const auto is_joined = [&](const std::string& address) {
    return std::ranges::find(identity->grpc, address) != identity->grpc.end();
  };
  if (identity.ok() && std::ranges::any_of(addresses, is_joined)) {
    (void)KeepRenewed(folder, kRenewalTimeout).ok();
  }
  return files;
}

absl::Status WhyRefused(const std::string& address, const wire::ClientIdentity& identity) {
  const IdentityFolder folder = IdentityFolder::In(identity.folder, identity.stem);
  if (!folder.Exists()) return absl::OkStatus();
  const absl::StatusOr<PeerIdentity> loaded = folder.Load();
  if (!loaded.ok() || std::ranges::find(loaded->grpc, address) == loaded->grpc.end()) {
    return absl::OkStatus();
  }
  return ExplainRefusal(folder, kRenewalTimeout);
}

}  // namespace rigcal::client

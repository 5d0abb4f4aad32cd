// SPDX-License-Identifier: Apache-2.0
#include "client/net/user_identity.h"

#include <algorithm>
#include <chrono>

#include "common/enrolment/join_server.h"
#include "common/identity/identity_folder.h"

namespace rigcal::client {
namespace {

// A command must not wait for long for what can be done by the next one.
constexpr std::chrono::milliseconds kRenewalTimeout{2000};

}  // namespace

wire::ClientIdentity RenewedUserIdentity(const std::string& address) {
  const wire::ClientIdentity files = wire::ClientIdentity::OfUser();
  if (!files.Exists()) return files;
  const IdentityFolder folder = IdentityFolder::OfUser(UserConfigFolder());
  const absl::StatusOr<PeerIdentity> identity = folder.Load();
  if (!identity.ok() || std::ranges::find(identity->grpc, address) == identity->grpc.end() ||
      !IsRenewalDue(*identity)) {
    return files;
  }
  const auto renewed = RenewIdentity(*identity, kRenewalTimeout);
  if (renewed.ok() && renewed->has_value()) (void)folder.Renew(**renewed).ok();
  return files;
}

}  // namespace rigcal::client

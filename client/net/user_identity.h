// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "absl/status/status.h"
#include "common/wire/server_access.h"

namespace rigcal::client {

// The identity with which this user asks `servers`, addresses with commas between; where the
// certificate for it is due, or the server was not asked for a day, it is renewed first, for at
// most a few seconds. A certificate that could not be renewed may still do; WhyRefused says why it
// does not.
wire::ClientIdentity RenewedUserIdentity(const std::string& servers);

// Why the server at `address`, which cannot be reached with this identity, does not let it in, as
// ExplainRefusal. OK: nothing is known that speaks against it.
absl::Status WhyRefused(const std::string& address, const wire::ClientIdentity& identity);

}  // namespace rigcal::client

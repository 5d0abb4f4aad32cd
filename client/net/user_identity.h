// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "common/wire/server_access.h"

namespace rigcal::client {

// The identity with which this user asks the server at `address`; where the certificate for it is
// due, it is renewed first, for at most a few seconds. A certificate that could not be renewed may
// still do; rigcal doctor says why it does not.
wire::ClientIdentity RenewedUserIdentity(const std::string& address);

}  // namespace rigcal::client

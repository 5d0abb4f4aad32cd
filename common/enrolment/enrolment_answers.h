// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/enrolment/https_call.h"
#include "common/identity/identity_folder.h"
#include "common/identity/join_string.h"

namespace rigcal {

// What a server answers to who joins. `address` is where it was asked, for messages.

// The CA's certificate in the answer to /v1/ca, which anybody may have given: that of the join
// string, written anew, and nothing that came with it.
//   UNAVAILABLE          it shows no certificate
//   FAILED_PRECONDITION  it is another one than the join string's, or not alone
absl::StatusOr<std::string> ReadCa(const std::string& address, const HttpsAnswer& answer,
                                   const JoinString& join);

// The certificate and the addresses of servers in the answer to /v1/enrol or /v1/renew: one
// certificate of the identity's CA for its key, and where nothing is named the addresses that the
// identity has. Only the server itself may have given the answer. An error leaves `identity` as it
// was.
//   UNAVAILABLE          it is no such answer
//   FAILED_PRECONDITION  it holds more than one certificate, or one for another key
//   UNAUTHENTICATED      the certificate is not of the CA
//   others               the server's own refusal
absl::Status ReadIssued(const std::string& address, const HttpsAnswer& answer,
                        PeerIdentity* identity);

}  // namespace rigcal

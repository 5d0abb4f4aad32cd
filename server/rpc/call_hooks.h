// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/security/server_credentials.h>
#include <grpcpp/support/server_interceptor.h>

#include <memory>

#include "server/rpc/call_security.h"

namespace rigcal::server {

// Credentials of the TLS port: the certificate that `identity` has checked, replaced when it does
// so again; clients must have one that `security` identifies; each call is authorised before it
// reaches a service, and a refused one ends with its reason. TLS 1.2 and 1.3. Both must outlive the
// server.
std::shared_ptr<grpc::ServerCredentials> MakeTlsCredentials(const CheckedIdentity& identity,
                                                            CallSecurity* security);

// Notes whose each connection is, and writes a line to the audit log for each call that changes
// something, with its request and result.
std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface> MakeCallObserver(
    CallSecurity* security);

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/audit/audit_log.h"
#include "server/http/http_request.h"
#include "server/identity/identity_authority.h"

namespace rigcal::server {

// Browsers that sign in with a join string and get a cookie; docs/api.md describes them:
//   POST /v1/login    {"token": "rk1..."}
//   GET /v1/login     who one is
//   POST /v1/logout   ends it
// `authority` null: only this machine uses the server. Both outlive them; `audit` null: nothing is
// written.
std::vector<HttpRoute> LoginRoutes(IdentityAuthority* authority, AuditLog* audit);

// Who sent a request: somebody on this machine, or whose cookie (or Authorization: Bearer) it is.
// UNAUTHENTICATED: nobody that the server knows.
absl::StatusOr<Peer> CallerOf(const IdentityAuthority* authority, const HttpRequest& request);

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <vector>

#include "absl/status/status.h"
#include "server/audit/audit_log.h"
#include "server/http/http_request.h"
#include "server/identity/identity_authority.h"

namespace rigcal::server {

// Everybody may ask; docs/api.md describes bodies and errors:
//   GET /v1/ca        the CA's certificate, as PEM
//   POST /v1/enrol    a certificate for a secret and a request
//   POST /v1/renew    a certificate for an older one and a request signed with the same key
//   GET /healthz      200 while the server runs
//   GET /readyz       200 while `ready` returns OK, else 503 with its message
// `authority` and `audit` outlive them. `authority` null: nobody can join, only the last two are
// there. `audit` null: nothing is written.
std::vector<HttpRoute> IdentityRoutes(IdentityAuthority* authority, AuditLog* audit,
                                      std::function<absl::Status()> ready);

}  // namespace rigcal::server

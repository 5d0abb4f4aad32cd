// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace rigcal::server {

// Sends what the gRPC library logs to our own log, at level debug: what matters of it comes back as
// a status, with our words. Process-wide.
void RouteGrpcLog();

}  // namespace rigcal::server

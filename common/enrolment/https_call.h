// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace rigcal {

struct HttpsRequest {
  std::string address;    // HOST:PORT
  std::string method;     // "GET"
  std::string path;       // "/v1/ca"
  std::string body = {};  // JSON
  // The CA that must have signed the server's certificate: one certificate, as
  // ParseOnlyCertificate. Empty: any server may answer, so nothing that is secret may be sent, and
  // nothing in the answer is to be believed without a check.
  std::string ca_pem = {};
  std::chrono::milliseconds timeout{10'000};  // for all of it
};

struct HttpsAnswer {
  unsigned status = 0;
  std::string body;                       // at most 64 KiB
  std::optional<absl::Time> server_time;  // by its clock
};

// One request over a connection of its own. The times in the server's certificate are not looked
// at: this PC's clock may be wrong.
//   UNAVAILABLE         nobody answers there, or it is no HTTPS server
//   UNAUTHENTICATED     the server's certificate is not of the CA or not for this host; nothing
//                       was sent
absl::StatusOr<HttpsAnswer> CallHttps(const HttpsRequest& request);

}  // namespace rigcal

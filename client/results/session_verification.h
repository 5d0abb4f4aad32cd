// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "rigcal/v1/session_service.pb.h"

namespace rigcal::client {

// Where the observations of one stream are. detected = durable + spooled + dropped + missing.
struct VerifiedStream {
  std::string camera;
  uint32_t stream_epoch = 1;
  std::string state;                        // for people: "complete", "in its agent's spool"
  uint64_t detected = 0;                    // numbers that were given, as far as anybody knows
  uint64_t durable = 0;                     // in the store, refused ones included
  uint64_t spooled = 0;                     // with the agent
  std::map<std::string, uint64_t> dropped;  // by reason: "spool_full"
  uint64_t missing = 0;                     // nobody has them
  std::string fault;                        // empty: the sum holds

  uint64_t dropped_count() const {
    uint64_t sum = 0;
    for (const auto& [reason, count] : dropped) sum += count;
    return sum;
  }
};

// Proves for every stream of a session that no observation was lost without being counted.
struct SessionVerification {
  std::string session_id;
  std::vector<VerifiedStream> streams;  // by camera and stream epoch

  bool holds() const;
};

// `response`: with its audit.
SessionVerification VerifySession(const v1::GetSessionResponse& response);

// A table, and below it a line for each fault or the sum.
std::string FormatVerification(const SessionVerification& verification);
// Keys as the members are called, and `holds`.
std::string VerificationJson(const SessionVerification& verification);

}  // namespace rigcal::client

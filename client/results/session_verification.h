// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "rigcal/v1/agent_service.pb.h"
#include "rigcal/v1/session_service.pb.h"

namespace rigcal::client {

// Where the observations of one stream are.
// detected = durable + damaged + spooled + dropped + missing.
struct VerifiedStream {
  std::string camera;
  uint32_t stream_epoch = 1;
  std::string state;                        // for people: "complete", "with its agent"
  uint64_t detected = 0;                    // numbers that were given, as far as anybody knows
  uint64_t durable = 0;                     // in the store and readable, refused ones included
  uint64_t late = 0;                        // of these, too late for a calibration
  uint64_t damaged = 0;                     // in the store, and cannot be read
  uint64_t spooled = 0;                     // with the agent, as it last told
  std::map<std::string, uint64_t> dropped;  // by reason: "spool_full"
  uint64_t missing = 0;                     // nobody has them

  uint64_t dropped_count() const {
    uint64_t sum = 0;
    for (const auto& [reason, count] : dropped) sum += count;
    return sum;
  }
};

// Observations with consecutive numbers. `last` 0: it is not known which is the last one.
struct VerifiedRows {
  uint32_t first = 0;
  uint32_t last = 0;
};

// Why a session is not verified.
struct VerificationProblem {
  // For programs: not_started, capturing, draining, deleted, no_stream, conflict, waiting, away,
  // no_agent, gone, end_unknown, damaged, missing, surplus, went_back.
  std::string kind;
  std::string camera;              // empty: the whole session
  uint32_t stream_epoch = 0;       // 0: all streams
  uint64_t count = 0;              // observations, as far as anybody knows
  std::vector<VerifiedRows> rows;  // their numbers; the first ones of many
  std::string where;               // where they are: "agent pc-1", "the store"
  std::string text;                // all of it, for people
  std::string what_to_do;
};

// Proves that everything that was detected in a session can be read from the server or is counted
// as dropped.
struct SessionVerification {
  std::string session_id;
  std::vector<VerifiedStream> streams;        // by camera and stream epoch
  std::vector<VerificationProblem> problems;  // empty: proved

  bool holds() const { return problems.empty(); }
};

// `response`: with its audit. `agents`: those that the server knows; where they are and what their
// spools are called is taken from it.
SessionVerification VerifySession(const v1::GetSessionResponse& response,
                                  const v1::ListAgentsResponse& agents = {});

// A table, and below it a line for each problem or the sum.
std::string FormatVerification(const SessionVerification& verification);
// Keys as the members are called, and `holds`; docs/usage.md shows it.
std::string VerificationJson(const SessionVerification& verification);

}  // namespace rigcal::client

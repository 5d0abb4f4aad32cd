// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/status/refusal.h"

namespace rigcal {

// What an agent's spool holds and has lost of one stream, beside what the server has.
struct SpoolReport {
  uint32_t last_seq = 0;              // numbers given so far, as far as they survive in the spool
  uint32_t acknowledged_seq = 0;      // the server has acknowledged all up to it
  uint64_t spooled_count = 0;         // rows that are kept and not acknowledged
  std::vector<Refusal> dropped = {};  // rows that will never be sent; `camera` is empty
  // The capture ended with the agent, and nothing proves that no row followed last_seq.
  bool end_is_unknown = false;

  friend bool operator==(const SpoolReport&, const SpoolReport&) = default;
};

// An agent's spool as a whole.
struct SpoolStatus {
  uint64_t row_count = 0;  // not acknowledged
  uint64_t bytes = 0;
  uint64_t limit_bytes = 0;
  std::vector<Refusal> dropped = {};  // rows that will never be sent; `camera` is empty
  std::string folder = {};            // empty: in memory, ends with the agent
  std::string problem = {};           // empty: healthy; else what it is and what to do

  friend bool operator==(const SpoolStatus&, const SpoolStatus&) = default;
};

}  // namespace rigcal

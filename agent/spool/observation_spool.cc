// SPDX-License-Identifier: Apache-2.0
#include "agent/spool/observation_spool.h"

#include <algorithm>

namespace rigcal::agent {

SpoolReport SpoolReportOf(const SpooledStream& stream) {
  return {.last_seq = std::max(stream.synced_seq, stream.durable_seq),
          .acknowledged_seq = stream.durable_seq,
          .spooled_count = stream.row_count,
          .dropped = ListOf(stream.dropped),
          .end_is_unknown = stream.end_is_unknown};
}

std::vector<Refusal> ListOf(const DropCounts& dropped) {
  std::vector<Refusal> list;
  for (const auto& [reason, count] : dropped) {
    list.push_back({.camera = "", .reason = reason, .count = count, .example = ""});
  }
  return list;
}

}  // namespace rigcal::agent

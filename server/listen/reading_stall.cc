// SPDX-License-Identifier: Apache-2.0
#include "server/listen/reading_stall.h"

#include <utility>

namespace rigcal::server {

bool ReadingStall::Look(const std::vector<ConnectionTraffic>& open, Clock::time_point now) {
  std::map<uint64_t, Seen> all;
  size_t read = 0;
  bool waits = false;
  for (const ConnectionTraffic& traffic : open) {
    const Seen& seen = all[traffic.id] = {.received_bytes = traffic.received_bytes,
                                          .waiting_bytes = traffic.waiting_bytes};
    const auto found = last_.find(traffic.id);
    const Seen last = found == last_.end() ? Seen{} : found->second;
    if (seen.received_bytes > last.received_bytes) {
      ++read;
    } else if (seen.waiting_bytes > 0 && last.waiting_bytes > 0) {
      waits = true;
    }
  }
  last_ = std::move(all);
  if (!waits || read > readers_) last_flow_ = now;
  return now - last_flow_ >= kLasting;
}

}  // namespace rigcal::server

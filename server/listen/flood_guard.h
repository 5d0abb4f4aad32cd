// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace rigcal::server {

// What has crossed a TCP connection since it was accepted.
struct ConnectionTraffic {
  uint64_t id = 0;              // never used again
  uint64_t received_bytes = 0;  // and read by gRPC
  uint64_t sent_bytes = 0;
  uint64_t explained_bytes = 0;  // received in messages that services have got, and their headers
  uint64_t waiting_bytes = 0;    // received and not read by gRPC
};

struct FloodLimits {
  // Flow control lets a stream have so many bytes on their way to a service that is busy: 4 MB/s
  // over a line of 30 ms, 128 MB/s over one of 1 ms. So much of a connection's unexplained bytes is
  // memory that was offered to it. Less than slow_bytes.
  uint64_t window_bytes = 128u << 10;
  // Received over one connection and not explained: one and a half of the largest messages.
  uint64_t unexplained_bytes = 6u << 20;
  // From here on a connection is a suspect, if half of what it received lately is not explained.
  uint64_t suspect_bytes = 64u << 10;
  // Growth of the process's memory since it had no suspect, without what was offered, at which the
  // greatest suspect is cut; and at which the connection with most unexplained bytes is, whatever
  // their share, if they are as many as `least_bytes`.
  uint64_t memory_growth_bytes = 96u << 20;
  uint64_t most_memory_growth_bytes = 256u << 20;
  uint64_t least_bytes = 16u << 10;
  // With so many bytes unexplained and others that wait, gRPC must read this many a second. It
  // copies all of an unfinished header for each frame that continues it, and serves nobody else
  // from that thread meanwhile.
  uint64_t slow_bytes = 256u << 10;
  uint64_t least_bytes_per_second = 1u << 20;
  std::chrono::milliseconds slow_time{500};
};

// Finds connections whose traffic fills the server's memory. gRPC 1.51 bounds neither header blocks
// (CVE-2023-33953) nor cancelled calls (CVE-2023-44487), and tells nobody of them; but what it has
// read and not given to a service is such traffic, or a message of which a part is missing.
//
// Bytes count as explained, too, where a connection cannot do without them: per second, for
// keepalive; per byte of messages, for TLS and HTTP/2; per byte sent, for its acknowledgement. Not
// for several threads.
class FloodGuard {
 public:
  using Clock = std::chrono::steady_clock;

  explicit FloodGuard(FloodLimits limits = {}) : limits_(limits) {}

  struct Cut {
    uint64_t id;
    std::string why;  // "it has sent 8.4 MB that no call accounts for"
  };
  // The connections that must be cut now. To be called several times a second, with all open ones.
  // `memory_bytes`: resident in this process, without what it holds of whole messages; 0: not
  // known.
  std::vector<Cut> Look(const std::vector<ConnectionTraffic>& open, uint64_t memory_bytes,
                        Clock::time_point now);
  // There was a suspect the last time: look again soon.
  bool has_suspect() const { return has_suspect_; }

 private:
  struct Account {
    ConnectionTraffic last;
    double unexplained = 0;     // bytes
    double received_since = 0;  // since all was explained
    Clock::time_point slow_since = {};
    uint64_t slow_from = 0;  // received_bytes then
  };
  // Bytes were waiting at every look of the last `slow_time`, and few were read.
  bool IsSlow(Account* account, Clock::time_point now) const;

  const FloodLimits limits_;
  std::map<uint64_t, Account> accounts_;
  Clock::time_point last_look_ = {};
  double calm_memory_ = 0;
  bool has_suspect_ = false;
};

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <utility>

#include "common/session/stream_key.h"
#include "rigcal/v1/ingest_service.pb.h"

namespace rigcal::server {

// What waits to be written to one agent, bounded. The hello goes first and nothing before it; then
// answers to pings, commands in their order, and acknowledgements. Acknowledgements of one stream
// are merged into its newest. Not thread-safe.
class OutgoingMessages {
 public:
  static constexpr size_t kMaxCommands = 1024;
  static constexpr size_t kMaxAckStreams = 1024;
  static constexpr size_t kMaxPings = 16;
  static constexpr size_t kMaxFaults = 16;  // listed per acknowledgement

  void SetHello(v1::ServerHello hello) { hello_ = std::move(hello); }
  // False: full; the agent does not read what it is sent.
  bool AddCommand(v1::ConnectResponse command);
  bool AddAck(BatchAck ack);
  // The oldest of more than kMaxPings is left unanswered.
  void AddPing(int64_t host_monotonic_ns);

  // Takes the next message out. False: there is none that may be written now. A ping's answer is
  // stamped with `server_utc_ns`.
  bool Next(int64_t server_utc_ns, v1::ConnectResponse* message);
  bool empty() const { return !hello_ && pings_.empty() && commands_.empty() && acks_.empty(); }

 private:
  std::optional<v1::ServerHello> hello_;
  bool hello_sent_ = false;
  std::deque<int64_t> pings_;
  std::deque<v1::ConnectResponse> commands_;
  std::deque<BatchAck> acks_;
};

}  // namespace rigcal::server

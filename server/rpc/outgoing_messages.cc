// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/outgoing_messages.h"

#include <algorithm>

#include "common/wire/observation_wire.h"

namespace rigcal::server {
namespace {

void MergeInto(BatchAck newer, BatchAck* ack) {
  ack->durable_seq = std::max(ack->durable_seq, newer.durable_seq);
  ack->send_limit_seq = std::max(ack->send_limit_seq, newer.send_limit_seq);
  ack->complete = ack->complete || newer.complete;
  ack->standby_durable_seq = std::max(ack->standby_durable_seq, newer.standby_durable_seq);
  ack->standby_complete = ack->standby_complete || newer.standby_complete;
  ack->fault_count += newer.fault_count;
  ack->conflict_count += newer.conflict_count;
  for (ObservationFault& fault : newer.faults) {
    if (ack->faults.size() >= OutgoingMessages::kMaxFaults) break;
    ack->faults.push_back(std::move(fault));
  }
}

}  // namespace

bool OutgoingMessages::AddCommand(v1::ConnectResponse command) {
  if (commands_.size() >= kMaxCommands) return false;
  commands_.push_back(std::move(command));
  return true;
}

bool OutgoingMessages::AddAck(BatchAck ack) {
  const auto same = std::find_if(acks_.begin(), acks_.end(), [&](const BatchAck& waiting) {
    return waiting.stream == ack.stream;
  });
  if (same != acks_.end()) {
    MergeInto(std::move(ack), &*same);
    return true;
  }
  if (acks_.size() >= kMaxAckStreams) return false;
  acks_.push_back(std::move(ack));
  return true;
}

void OutgoingMessages::AddPing(int64_t host_monotonic_ns) {
  if (pings_.size() >= kMaxPings) pings_.pop_front();
  pings_.push_back(host_monotonic_ns);
}

bool OutgoingMessages::Next(int64_t server_utc_ns, v1::ConnectResponse* message) {
  if (hello_) {
    *message->mutable_hello() = *std::exchange(hello_, std::nullopt);
    hello_sent_ = true;
    return true;
  }
  if (!hello_sent_) return false;
  if (!pings_.empty()) {
    v1::TimePong* pong = message->mutable_time_pong();
    pong->set_host_monotonic_ns(pings_.front());
    pong->set_server_utc_ns(server_utc_ns);
    pings_.pop_front();
    return true;
  }
  if (!commands_.empty()) {
    *message = std::move(commands_.front());
    commands_.pop_front();
    return true;
  }
  if (!acks_.empty()) {
    *message->mutable_ack() = wire::ToProto(acks_.front());
    acks_.pop_front();
    return true;
  }
  return false;
}

}  // namespace rigcal::server

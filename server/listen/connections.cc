// SPDX-License-Identifier: Apache-2.0
#include "server/listen/connections.h"

#include <unistd.h>

#include "server/listen/listen_socket.h"

namespace rigcal::server {
namespace {

constexpr size_t kMaxComplaints = 1024;

}  // namespace

Connections::~Connections() {
  for (const auto& [descriptor, connection] : by_descriptor_) close(descriptor);
}

Connections::Verdict Connections::Check(const sockaddr_storage& from) const {
  const std::string group = AddressGroup(from);
  std::lock_guard lock(mutex_);
  // Clients over the socket file have no address.
  const auto there = per_group_.find(group);
  if (!group.empty() && there != per_group_.end() && there->second >= limits_.per_address) {
    return Verdict::kTooManyFromThere;
  }
  return by_descriptor_.size() >= limits_.total ? Verdict::kTooManyInAll : Verdict::kWelcome;
}

bool Connections::NoteRefusal(Verdict verdict, const sockaddr_storage& from) {
  std::lock_guard lock(mutex_);
  if (complained_.size() >= kMaxComplaints) complained_.clear();
  return complained_.insert(verdict == Verdict::kTooManyInAll ? "" : AddressGroup(from)).second;
}

void Connections::Add(int descriptor, const sockaddr_storage& from) {
  Connection connection{.address = AddressText(from), .group = AddressGroup(from), .peer = {}};
  std::lock_guard lock(mutex_);
  ++stats_.accepted;
  ++per_group_[connection.group];
  if (!connection.address.empty()) by_address_[connection.address] = descriptor;
  by_descriptor_[descriptor] = std::move(connection);
}

bool Connections::Remove(int descriptor) {
  std::lock_guard lock(mutex_);
  const auto found = by_descriptor_.find(descriptor);
  if (found == by_descriptor_.end()) return false;
  const Connection& connection = found->second;
  // Down to half of a limit, and the next refusal is news again.
  const auto group = per_group_.find(connection.group);
  if (--group->second <= limits_.per_address / 2) complained_.erase(connection.group);
  if (group->second == 0) per_group_.erase(group);
  const bool had_calls = connection.peer.has_certificate;
  const auto place = by_address_.find(connection.address);
  if (place != by_address_.end() && place->second == descriptor) by_address_.erase(place);
  by_descriptor_.erase(found);
  if (by_descriptor_.size() <= limits_.total / 2) complained_.erase("");
  close(descriptor);
  return had_calls;
}

void Connections::CountRefused() {
  std::lock_guard lock(mutex_);
  ++stats_.refused;
}

std::string Connections::AddressOf(int descriptor) const {
  std::lock_guard lock(mutex_);
  const auto found = by_descriptor_.find(descriptor);
  return found == by_descriptor_.end() ? "" : found->second.address;
}

void Connections::SetPeer(const std::string& address, const Peer& peer) {
  std::lock_guard lock(mutex_);
  const auto place = by_address_.find(address);
  if (place != by_address_.end()) by_descriptor_.at(place->second).peer = peer;
}

std::vector<Peer> Connections::CutIf(const std::function<bool(const Peer&)>& matches) {
  std::vector<Peer> peers;
  std::lock_guard lock(mutex_);
  for (auto& [descriptor, connection] : by_descriptor_) {
    if (connection.cut || !connection.peer.has_certificate || !matches(connection.peer)) continue;
    // gRPC reads the end of the connection and ends every call on it.
    shutdown(descriptor, SHUT_RDWR);
    connection.cut = true;
    peers.push_back(connection.peer);
  }
  return peers;
}

ConnectionStats Connections::Stats() const {
  std::lock_guard lock(mutex_);
  ConnectionStats stats = stats_;
  stats.open = static_cast<uint32_t>(by_descriptor_.size());
  return stats;
}

}  // namespace rigcal::server

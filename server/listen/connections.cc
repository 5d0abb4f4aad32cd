// SPDX-License-Identifier: Apache-2.0
#include "server/listen/connections.h"

#include <linux/sockios.h>
#include <linux/tcp.h>
#include <netinet/in.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <utility>

#include "server/listen/listen_socket.h"

namespace rigcal::server {
namespace {

constexpr size_t kMaxComplaints = 1024;
constexpr size_t kMaxFloods = 16;
// When a limit is reached, so long without a call or a message makes a connection idle. An agent
// sends something every second.
constexpr std::chrono::seconds kUnused{1};
constexpr std::chrono::seconds kIdle{20};
// gRPC gives up a handshake after 5 s.
constexpr std::chrono::seconds kLongestHandshake{6};

// Ends a connection at once: what has arrived and was not read yet is thrown away, which shutdown()
// would still give to gRPC, together with all that goes on arriving.
void Abort(int descriptor) {
  sockaddr nowhere{};
  nowhere.sa_family = AF_UNSPEC;
  if (connect(descriptor, &nowhere, sizeof(nowhere)) != 0) shutdown(descriptor, SHUT_RDWR);
}

// False: not a TCP connection.
bool ReadTraffic(int descriptor, ConnectionTraffic* traffic) {
  tcp_info info{};
  socklen_t size = sizeof(info);
  if (getsockopt(descriptor, IPPROTO_TCP, TCP_INFO, &info, &size) != 0) return false;
  int waiting = 0;
  if (ioctl(descriptor, SIOCINQ, &waiting) != 0) waiting = 0;
  const auto unread = static_cast<uint64_t>(std::max(waiting, 0));
  traffic->received_bytes =
      info.tcpi_bytes_received - std::min(unread, uint64_t{info.tcpi_bytes_received});
  traffic->waiting_bytes = unread;
  traffic->sent_bytes = info.tcpi_bytes_acked;
  return true;
}

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
  Connection connection{.address = AddressText(from),
                        .group = AddressGroup(from),
                        .peer = {},
                        .begin = std::chrono::steady_clock::now()};
  std::lock_guard lock(mutex_);
  connection.id = ++last_id_;
  ++stats_.accepted;
  ++per_group_[connection.group];
  if (!connection.address.empty()) by_address_[connection.address] = descriptor;
  by_descriptor_[descriptor] = std::move(connection);
}

void Connections::SetPlain(int descriptor) {
  std::lock_guard lock(mutex_);
  if (const auto found = by_descriptor_.find(descriptor); found != by_descriptor_.end()) {
    found->second.plain = true;
  }
}

void Connections::Cut(int descriptor) {
  std::lock_guard lock(mutex_);
  const auto found = by_descriptor_.find(descriptor);
  if (found == by_descriptor_.end()) return;
  Abort(descriptor);
  found->second.cut = true;
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
  const bool had_calls = connection.peer.has_certificate || connection.cut;
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

const Peer* Connections::PeerOf(const Connection& connection) {
  if (connection.peer.has_certificate) return &connection.peer;
  return connection.handshakes.size() == 1 ? &connection.handshakes.begin()->second : nullptr;
}

void Connections::NoteHandshake(const Peer& peer, std::chrono::steady_clock::time_point now) {
  std::lock_guard lock(mutex_);
  std::vector<Connection*> possible;
  for (auto& [descriptor, connection] : by_descriptor_) {
    if (!connection.cut && !connection.plain && !connection.peer.has_certificate &&
        !connection.handshake_is_certain && now - connection.begin < kLongestHandshake) {
      possible.push_back(&connection);
    }
  }
  for (Connection* const connection : possible) {
    connection->handshakes.emplace(peer.uri, peer);
    if (possible.size() > 1) continue;
    connection->handshakes = {{peer.uri, peer}};
    connection->handshake_is_certain = true;
  }
}

void Connections::Explain(const std::string& address, uint64_t bytes) {
  std::lock_guard lock(mutex_);
  const auto place = by_address_.find(address);
  if (place == by_address_.end()) return;
  Connection& connection = by_descriptor_.at(place->second);
  connection.explained_bytes += bytes;
  connection.last_message = std::chrono::steady_clock::now();
}

std::optional<int> Connections::FindIdle(const sockaddr_storage& from, Verdict verdict,
                                         std::chrono::steady_clock::time_point now) const {
  const std::string group = AddressGroup(from);
  std::optional<int> choice;
  std::pair<bool, std::chrono::steady_clock::time_point> least;
  std::lock_guard lock(mutex_);
  for (const auto& [descriptor, connection] : by_descriptor_) {
    if (connection.address.empty()) continue;  // the own user's, over the socket file
    if (verdict == Verdict::kTooManyFromThere && connection.group != group) continue;
    const bool was_used = connection.explained_bytes > 0;
    const auto since = was_used ? connection.last_message : connection.begin;
    if (now - since < (was_used ? kIdle : kUnused)) continue;
    const std::pair rank(was_used, since);
    if (!choice || rank < least) {
      choice = descriptor;
      least = rank;
    }
  }
  return choice;
}

std::vector<Peer> Connections::CutIf(const std::function<bool(const Peer&)>& matches) {
  std::vector<Peer> peers;
  std::lock_guard lock(mutex_);
  for (auto& [descriptor, connection] : by_descriptor_) {
    const Peer* const peer = PeerOf(connection);
    if (connection.cut || peer == nullptr || !matches(*peer)) continue;
    // gRPC reads the end of the connection and ends every call on it.
    Abort(descriptor);
    connection.cut = true;
    peers.push_back(*peer);
  }
  return peers;
}

std::vector<ConnectionTraffic> Connections::Traffic() const {
  std::vector<ConnectionTraffic> all;
  std::lock_guard lock(mutex_);
  for (const auto& [descriptor, connection] : by_descriptor_) {
    ConnectionTraffic traffic{.id = connection.id, .explained_bytes = connection.explained_bytes};
    if (connection.cut || connection.address.empty() || !ReadTraffic(descriptor, &traffic)) {
      continue;
    }
    all.push_back(traffic);
  }
  return all;
}

std::optional<Connections::Flooding> Connections::CutFlood(uint64_t id, const std::string& why) {
  std::lock_guard lock(mutex_);
  for (auto& [descriptor, connection] : by_descriptor_) {
    if (connection.id != id || connection.cut) continue;
    Abort(descriptor);
    connection.cut = true;
    Flooding flooding{.address = connection.address, .peer = {}, .is_plain = connection.plain};
    if (const Peer* const peer = PeerOf(connection)) flooding.peer = *peer;
    AddFlood({.address = flooding.address,
              .peer = flooding.peer ? Describe(*flooding.peer) : "",
              .why = why});
    return flooding;
  }
  return std::nullopt;
}

void Connections::NoteFlood(const Peer& peer, const std::string& why) {
  std::lock_guard lock(mutex_);
  AddFlood({.peer = Describe(peer), .why = why});
}

void Connections::AddFlood(FloodRecord record) {
  record.time = std::chrono::system_clock::now();
  ++stats_.flooding;
  floods_.push_front(std::move(record));
  if (floods_.size() > kMaxFloods) floods_.pop_back();
}

std::vector<FloodRecord> Connections::Floods() const {
  std::lock_guard lock(mutex_);
  return {floods_.begin(), floods_.end()};
}

ConnectionStats Connections::Stats() const {
  std::lock_guard lock(mutex_);
  ConnectionStats stats = stats_;
  stats.open = static_cast<uint32_t>(by_descriptor_.size());
  return stats;
}

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/socket.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "server/access/peer.h"
#include "server/listen/flood_guard.h"

namespace rigcal::server {

struct ConnectionLimits {
  size_t total = 1024;
  size_t per_address = 256;  // an IPv4 address, or an IPv6 network of 64 bits
};

struct ConnectionStats {
  uint32_t open = 0;
  uint64_t accepted = 0;
  uint64_t refused = 0;   // too many connections, or not what this port is for
  uint64_t flooding = 0;  // cut by the server because of what came over them
};

// A connection that was cut because of what came over it.
struct FloodRecord {
  std::chrono::system_clock::time_point time = {};
  std::string address = {};
  std::string peer = {};  // as Describe; empty: not known
  std::string why = {};
};

// The open connections of a server: how many there are from where, and whose they are. Each is held
// by a descriptor of its own (gRPC gets a copy), so that it can be cut from here. Thread-safe.
class Connections {
 public:
  explicit Connections(ConnectionLimits limits) : limits_(limits) {}
  ~Connections();

  enum class Verdict { kWelcome, kTooManyInAll, kTooManyFromThere };
  // Whether one more may come from there.
  Verdict Check(const sockaddr_storage& from) const;
  // It was refused. True: for the first time in a row, so that it is worth a line in the log.
  bool NoteRefusal(Verdict verdict, const sockaddr_storage& from);
  // It began without TLS.
  void SetPlain(int descriptor);
  // Takes over `descriptor`.
  void Add(int descriptor, const sockaddr_storage& from);
  // Ends it, whoever else holds it.
  void Cut(int descriptor);
  // Closes it. True: it carried a call of a peer with a certificate, or was cut.
  bool Remove(int descriptor);
  // A connection that may go for another one from there, when a limit is reached: the oldest over
  // which no call has come, else the one that has been idle for longest. Null: all are in use.
  std::optional<int> FindIdle(const sockaddr_storage& from, Verdict verdict,
                              std::chrono::steady_clock::time_point now) const;
  void CountRefused();
  // As AddressText; empty: not open.
  std::string AddressOf(int descriptor) const;

  // A call of `peer` came over the connection from `address` (as AddressText).
  void SetPeer(const std::string& address, const Peer& peer);
  // A handshake with `peer` has succeeded over one of the connections that began lately; gRPC does
  // not say which. Where only one comes into question, it is his.
  void NoteHandshake(const Peer& peer, std::chrono::steady_clock::time_point now);
  // Bytes of messages and headers that a service has got over the connection from `address`.
  void Explain(const std::string& address, uint64_t bytes);
  // Ends every connection of a peer for which `matches` is true, and returns those peers.
  std::vector<Peer> CutIf(const std::function<bool(const Peer&)>& matches);

  // Of every connection over an IP address.
  std::vector<ConnectionTraffic> Traffic() const;
  struct Flooding {
    std::string address;
    std::optional<Peer> peer;  // null: not known
    bool is_plain = false;     // it came without TLS
  };
  // Ends a connection because of what came over it. Null: it is gone already.
  std::optional<Flooding> CutFlood(uint64_t id, const std::string& why);
  // The same for all connections of a peer.
  void NoteFlood(const Peer& peer, const std::string& why);
  // The last ones, newest first.
  std::vector<FloodRecord> Floods() const;

  ConnectionStats Stats() const;

 private:
  struct Connection {
    uint64_t id = 0;
    std::string address;
    std::string group;
    Peer peer;
    bool cut = false;
    bool plain = false;
    std::chrono::steady_clock::time_point begin = {};
    std::chrono::steady_clock::time_point last_message = {};  // none: the epoch
    uint64_t explained_bytes = 0;
    // Peers whose handshake may have been over this connection, by URI, until one is certain.
    std::map<std::string, Peer> handshakes = {};
    bool handshake_is_certain = false;
  };

  // With mutex_ held.
  static const Peer* PeerOf(const Connection& connection);
  void AddFlood(FloodRecord record);

  const ConnectionLimits limits_;
  mutable std::mutex mutex_;
  std::map<int, Connection> by_descriptor_;
  std::map<std::string, int> by_address_;
  std::map<std::string, size_t> per_group_;
  std::set<std::string> complained_;
  std::deque<FloodRecord> floods_;  // newest first
  uint64_t last_id_ = 0;
  ConnectionStats stats_;
};

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/socket.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "server/access/peer.h"

namespace rigcal::server {

struct ConnectionLimits {
  size_t total = 1024;
  size_t per_address = 256;  // an IPv4 address, or an IPv6 network of 64 bits
};

struct ConnectionStats {
  uint32_t open = 0;
  uint64_t accepted = 0;
  uint64_t refused = 0;  // too many connections, or not what this port is for
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
  // It was refused. True: the first time in a row, which somebody should hear of.
  bool NoteRefusal(Verdict verdict, const sockaddr_storage& from);
  // Takes over `descriptor`.
  void Add(int descriptor, const sockaddr_storage& from);
  // Closes it. True: it carried a call of a peer with a certificate.
  bool Remove(int descriptor);
  void CountRefused();
  // As AddressText; empty: not open.
  std::string AddressOf(int descriptor) const;

  // A call of `peer` came over the connection from `address` (as AddressText).
  void SetPeer(const std::string& address, const Peer& peer);
  // Ends every connection of a peer for which `matches` is true, and returns those peers.
  std::vector<Peer> CutIf(const std::function<bool(const Peer&)>& matches);

  ConnectionStats Stats() const;

 private:
  struct Connection {
    std::string address;
    std::string group;
    Peer peer;
    bool cut = false;
  };

  const ConnectionLimits limits_;
  mutable std::mutex mutex_;
  std::map<int, Connection> by_descriptor_;
  std::map<std::string, int> by_address_;
  std::map<std::string, size_t> per_group_;
  std::set<std::string> complained_;
  ConnectionStats stats_;
};

}  // namespace rigcal::server

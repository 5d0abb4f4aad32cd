// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace rigcal {

// What a server says of itself in its network.
struct ServerAnnouncement {
  std::string name = {};  // for people: that of its PC
  uint16_t grpc_port = 0;
  uint16_t https_port = 0;
};

// A server that announces itself. Anybody can announce anything: whether it is the right one shows
// when it is joined, by the hash in the join string.
struct FoundServer {
  std::string name = {};
  std::vector<std::string> hosts = {};  // IP addresses
  uint16_t grpc_port = 0;
  uint16_t https_port = 0;

  friend bool operator==(const FoundServer&, const FoundServer&) = default;
};

// Servers of the local network that announce themselves as services of the type _rigcal._tcp, by
// mDNS. Not for several threads.
class Discovery {
 public:
  // An announcement, until it is destroyed.
  class Announcement {
   public:
    virtual ~Announcement() = default;
  };

  virtual ~Discovery() = default;

  // The addresses are those of this PC. `trouble` says why the server is not announced, also later,
  // on another thread, and what to do. UNAVAILABLE: this PC has no mDNS; the message says what to
  // do.
  virtual absl::StatusOr<std::unique_ptr<Announcement>> Announce(
      const ServerAnnouncement& server, std::function<void(const std::string&)> trouble) = 0;

  // Those that answer within `patience`, sorted by name; at most kMostFound. UNAVAILABLE as above.
  virtual absl::StatusOr<std::vector<FoundServer>> Find(std::chrono::milliseconds patience) = 0;

  static constexpr size_t kMostFound = 32;
};

// By avahi-daemon. In a build without its library every call is UNAVAILABLE.
std::unique_ptr<Discovery> MakeDiscovery();

}  // namespace rigcal

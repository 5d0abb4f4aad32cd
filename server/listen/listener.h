// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/socket.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <filesystem>
#include <functional>
#include <list>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/access/peer_conduct.h"
#include "server/audit/audit_log.h"
#include "server/listen/connections.h"
#include "server/listen/flood_guard.h"
#include "server/listen/reading_stall.h"

namespace rigcal::server {

struct ListenerOptions {
  std::string address = {};                // HOST:PORT; empty: none
  std::filesystem::path socket_file = {};  // empty: none
  // Connections that begin with a TLS handshake are taken.
  bool tls = false;
  // Connections from this machine are taken without TLS. Others never are.
  bool plain_loopback = true;
  ConnectionLimits limits = {};
  // Connections that have not sent a byte; of more, the oldest is closed.
  size_t max_silent = 256;
  std::chrono::milliseconds first_byte_timeout{5'000};
  // How often the server connects to itself, and how long it waits for the answer.
  std::chrono::milliseconds probe_interval{10'000};
  std::chrono::milliseconds probe_timeout{5'000};
  FloodLimits floods = {};
  // Bytes of deliveries that wait to be stored: memory that is no flood. Empty: none. Called on the
  // accepting thread, several times a second.
  std::function<uint64_t()> waiting_bytes = {};
  // Connections wait, and the threads that read them, so many, are held by others (ReadingStall).
  // Called on the accepting thread at every look at which it is so. Empty: nobody need know.
  std::function<void()> on_stall = {};
  size_t readers = 2;
  // How often it looks for floods while there are connections; and while one is suspected.
  std::chrono::milliseconds flood_interval{50};
  std::chrono::milliseconds suspect_interval{10};
};

// Accepts connections and hands them over once their first byte says what they are: gRPC's own
// accept loop never recovers from a lack of descriptors, and knows no limits. One thread accepts,
// another one connects to the server now and then to see whether it does.
class Listener {
 public:
  enum class Kind { kPlain, kTls };
  // Takes over a connection's descriptor, which does not block. Called on the accepting thread.
  using Take = std::function<void(Kind, int descriptor)>;

  // Both must outlive the listener. Without `conduct` nobody is kept out after a flood.
  Listener(ListenerOptions options, AuditLog* audit, PeerConduct* conduct = nullptr);
  ~Listener();
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

  // Listens from here on; returns the port (0 without an address). Errors as ListenOn; a socket
  // file that cannot be made is logged and left out.
  absl::StatusOr<int> Bind();
  // Accepts from here on.
  void Start(Take take);
  // Accepts nothing more, and closes what was not handed over.
  void Stop();

  Connections& connections() { return connections_; }
  // The last two probes found that nobody accepts.
  bool IsDeaf() const { return failed_probes_ >= 2; }
  // Connects to the own port. False: nobody accepted in time. True without a port.
  bool Probe() const;

 private:
  using Clock = std::chrono::steady_clock;
  struct Silent {
    int descriptor;
    sockaddr_storage from;
    Clock::time_point deadline;
  };
  using SilentList = std::list<Silent>;

  void Run();
  void AcceptAll(int listening);
  // The connection of a client, or the error that accept4 gave.
  absl::StatusOr<int> AcceptOne(int listening, sockaddr_storage* from);
  void Welcome(int descriptor, const sockaddr_storage& from);
  // False: it is one too many, and none that is silent could be closed for it.
  bool MakeRoom(const sockaddr_storage& from);
  void DropSilent(SilentList::iterator silent);
  void Decide(SilentList::iterator silent);
  void HandOver(Kind kind, int descriptor, bool is_watched);
  void Refuse(int descriptor, const sockaddr_storage& from, const std::string& why);
  void Watch(int descriptor, uint32_t events, int operation) const;
  void PauseAccepting();
  void LookForFloods();
  // Of the memory that this process has, what deliveries that wait to be stored do not hold.
  uint64_t UnclaimedBytes(uint64_t resident_bytes);
  void GiveMemoryBack(uint64_t resident_bytes, Clock::time_point now);
  void RunProbes();

  const ListenerOptions options_;
  AuditLog& audit_;
  PeerConduct* const conduct_;
  Connections connections_;
  Take take_;
  int epoll_ = -1;
  int wake_ = -1;
  int reserve_ = -1;  // given up for a moment when there are no descriptors
  int internet_ = -1;
  int file_ = -1;
  int port_ = 0;
  SilentList silent_;  // oldest first
  std::map<int, SilentList::iterator> silent_by_descriptor_;
  std::map<int, Kind> taken_;
  std::optional<Clock::time_point> paused_until_;
  std::optional<Clock::time_point> last_lack_;  // of descriptors
  FloodGuard guard_;
  ReadingStall stall_;
  Clock::time_point next_look_ = {};
  // When memory goes back to the system next, and how much was left the last time.
  std::deque<Clock::time_point> give_back_;
  Clock::time_point next_give_back_ = {};
  uint64_t kept_bytes_ = 0;
  uint64_t most_waiting_bytes_ = 0;  // since then

  std::mutex mutex_;
  std::condition_variable stop_changed_;
  std::atomic<bool> stopping_ = false;
  std::atomic<int> failed_probes_ = 0;
  std::thread accepting_;
  std::thread probing_;
};

}  // namespace rigcal::server

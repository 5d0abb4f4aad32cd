// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <random>
#include <string>
#include <thread>
#include <vector>

namespace rigcal::testing {

// A TCP proxy on 127.0.0.1 in front of a server there, whose link a test makes bad. Each direction
// has its own state. Nothing is lost or reordered within a connection, since TCP repeats what a
// network loses: bytes come late, or not at all.
class TcpFaultProxy {
 public:
  enum class Direction : uint8_t { kToServer = 0, kToClient = 1 };

  // One direction of the link.
  struct Link {
    std::chrono::milliseconds latency{0};  // one way
    uint64_t bytes_per_s = 0;              // of all connections together; 0: no limit
    // Share of segments (1448 bytes) that are lost once. Each comes `repetition` later, and holds
    // up what is behind it.
    double loss = 0;
    std::chrono::milliseconds repetition{200};
    // Nothing arrives, the end of a connection neither, until this is false again; what was sent
    // meanwhile arrives then. Connections can still be made.
    bool is_black_hole = false;
  };

  explicit TcpFaultProxy(int server_port);
  // Resets what is open.
  ~TcpFaultProxy();
  TcpFaultProxy(const TcpFaultProxy&) = delete;
  TcpFaultProxy& operator=(const TcpFaultProxy&) = delete;

  int port() const { return port_; }
  std::string address() const { return "127.0.0.1:" + std::to_string(port_); }

  // Each has taken effect when it returns. What is on its way then arrives when it would have
  // before, unless it meets a black hole.
  void Set(Direction direction, const Link& link);
  void Set(const Link& link);  // both directions
  // Resets every connection, and from then on each new one, until Restore.
  void Cut();
  // As new: no fault in either direction.
  void Restore();

  // Connections that clients have made, those that were reset at once included.
  uint64_t attempt_count() const;
  // Bytes that have arrived.
  uint64_t byte_count(Direction direction) const;

 private:
  using Clock = std::chrono::steady_clock;
  struct State {
    std::array<Link, 2> links;  // by Direction
    bool cut = false;
    bool stop = false;
  };
  class Connection;

  void Change(const std::function<void(State&)>& edit);
  void Run();
  void Accept(bool cut);
  void Move(const State& state);
  // Until there is something to move, or the state changes.
  void Wait(const State& state);

  int port_ = 0;
  int listener_ = -1;
  int wake_ = -1;
  const int server_port_;

  mutable std::mutex mutex_;
  std::condition_variable change_followed_;
  State state_;
  uint64_t change_count_ = 0;    // of state_
  uint64_t followed_count_ = 0;  // of them, by the thread
  uint64_t attempt_count_ = 0;
  std::array<uint64_t, 2> byte_counts_{};

  // Of the thread.
  std::vector<std::unique_ptr<Connection>> connections_;
  std::array<Clock::time_point, 2> link_free_{};  // when the last byte accepted has left
  std::mt19937 random_{7};
  std::thread thread_;
};

}  // namespace rigcal::testing

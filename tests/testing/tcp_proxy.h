// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <list>
#include <string>
#include <thread>

namespace rigcal::testing {

// Passes TCP connections to one port of 127.0.0.1 on to another, until the link is said to fail.
class TcpProxy {
 public:
  explicit TcpProxy(int target_port);
  ~TcpProxy();
  TcpProxy(const TcpProxy&) = delete;
  TcpProxy& operator=(const TcpProxy&) = delete;

  int port() const { return port_; }
  // Resets every connection; new ones are passed on.
  void Cut() { cut_ = true; }
  // While it is down, nothing is passed on in either direction, and nobody is told: an unplugged
  // cable.
  void SetDown(bool down) { down_ = down; }

 private:
  struct Side {
    int descriptor = -1;
    std::string unsent;  // towards this side
    bool ended = false;  // has sent all of its bytes
  };
  struct Link {
    Side client;
    Side server;
  };

  void Run();
  void Accept();
  void CloseAll();
  // False: the link is over.
  static bool Pass(Side* from, Side* to);

  const int target_port_;
  int listening_ = -1;
  int port_ = 0;
  std::list<Link> links_;
  std::atomic<bool> cut_ = false;
  std::atomic<bool> down_ = false;
  std::atomic<bool> ending_ = false;
  std::thread thread_;
};

}  // namespace rigcal::testing

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <thread>

#include "tests/testing/test_ca.h"

namespace rigcal::testing {

// What a peer can send to an HTTP/2 server that costs the server more than the peer.
enum class Http2Attack {
  // Calls that are begun and cancelled at once (CVE-2023-44487).
  kRapidReset,
  // Header blocks of references to one long entry of the HPACK table (CVE-2023-33953).
  kHpackReferences,
  // A header block that goes on in CONTINUATION frames and never ends.
  kEndlessContinuation,
  // As above with one header, whose value is announced to be 256 MiB long.
  kEndlessHeader,
  // PING and SETTINGS frames, whose answers are never read.
  kUnreadAnswers,
};
const char* Name(Http2Attack attack);

// Sends one attack to a port of this machine on a thread of its own, over a new connection whenever
// the server has closed the last one.
class Http2Flood {
 public:
  struct Options {
    int port = 0;
    Http2Attack attack = Http2Attack::kRapidReset;
    std::optional<TestCertificate> certificate = {};  // empty: without TLS
    std::string path = "/rigcal.v1.StatusService/GetStatus";
    std::chrono::milliseconds pause{20};  // before the next connection
  };

  explicit Http2Flood(Options options);
  // Stops.
  ~Http2Flood();
  Http2Flood(const Http2Flood&) = delete;
  Http2Flood& operator=(const Http2Flood&) = delete;

  void Stop();
  uint64_t bytes_sent() const { return bytes_sent_; }
  // Connections over which frames were sent.
  int connections() const { return connections_; }
  // Those that the server has closed, or did not let in.
  int closed() const { return closed_; }

 private:
  class Connection;

  void Run();
  // False: the server has closed it.
  bool Attack(Connection& connection);

  const Options options_;
  std::atomic<bool> stopping_ = false;
  std::atomic<uint64_t> bytes_sent_ = 0;
  std::atomic<int> connections_ = 0;
  std::atomic<int> closed_ = 0;
  std::thread thread_;
};

}  // namespace rigcal::testing

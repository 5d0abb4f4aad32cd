// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>

namespace rigcal::server {

struct ConductLimits {
  // Calls that a peer has begun within `window` and that are not over: gRPC keeps 11 KB for each,
  // and for those that the peer has cancelled until it gets to them.
  size_t unfinished_calls = 2'000;
  std::chrono::seconds window{10};
  // How long a peer that was cut is kept out: at first, and after many times. Doubled each time.
  std::chrono::seconds first_ban{5};
  std::chrono::seconds longest_ban{300};
  // After so long without a cut the next one counts as the first.
  std::chrono::seconds forgiven_after{600};
};

// How peers with a certificate (by its URI) behave, and who is kept out for a while because of it.
// Thread-safe.
class PeerConduct {
 public:
  using Clock = std::chrono::steady_clock;

  explicit PeerConduct(ConductLimits limits = {}) : limits_(limits) {}

  // False: the peer has too many unfinished calls. Each call that was begun is ended once.
  bool BeginCall(const std::string& uri, Clock::time_point now);
  void EndCall(std::string_view uri);

  // The peer was cut. Returns how long it is kept out; the same as before while it already is.
  std::chrono::seconds Ban(const std::string& uri, const std::string& why, Clock::time_point now);
  struct Banned {
    std::string why;
    std::chrono::seconds left;  // at least 1 s
  };
  std::optional<Banned> FindBan(std::string_view uri, Clock::time_point now) const;

 private:
  struct Second {
    Clock::time_point begin;
    size_t begun = 0;
  };
  struct Record {
    std::deque<Second> seconds;  // within the window, oldest first
    size_t unfinished = 0;       // of the calls that these have begun
    std::string why;
    Clock::time_point banned_until = {};
    std::chrono::seconds ban{0};
  };

  const ConductLimits limits_;
  mutable std::mutex mutex_;
  std::map<std::string, Record, std::less<>> by_uri_;
};

}  // namespace rigcal::server

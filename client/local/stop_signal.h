// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <signal.h>

#include <array>
#include <chrono>

namespace rigcal::client {

// While one of these lives, SIGINT, SIGTERM and SIGHUP are noted instead of ending the process, so
// that it can clean up. One at a time, on the main thread.
class StopSignals {
 public:
  StopSignals();
  ~StopSignals();
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

  // Waits, at most until a signal arrives on this thread.
  void Sleep(std::chrono::milliseconds duration) const;

  // The first signal noted since the process began, for the exit code; 0: none.
  static int Received();

 private:
  static constexpr std::array<int, 3> kSignals = {SIGINT, SIGTERM, SIGHUP};
  std::array<struct sigaction, 3> before_;
};

}  // namespace rigcal::client

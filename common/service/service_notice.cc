// SPDX-License-Identifier: Apache-2.0
#include "common/service/service_notice.h"

#include <systemd/sd-daemon.h>
#include <time.h>

#include <algorithm>
#include <cstdint>

#include "absl/strings/str_cat.h"

namespace rigcal {
namespace {

constexpr uint64_t kMicrosecondsPerSecond = 1'000'000;
constexpr uint64_t kLookMicroseconds = 500'000;

// Zero: nobody waits for signs of life.
uint64_t WatchdogMicroseconds() {
  uint64_t limit_us = 0;
  return sd_watchdog_enabled(0, &limit_us) > 0 ? limit_us : 0;
}

timespec AsTimespec(uint64_t time_us) {
  timespec time{};
  time.tv_sec = static_cast<time_t>(time_us / kMicrosecondsPerSecond);
  time.tv_nsec = static_cast<long>(time_us % kMicrosecondsPerSecond) * 1000;
  return time;
}

}  // namespace

void TellReady(const std::string& status) {
  // A line of the message is an assignment of its own.
  sd_notify(0, absl::StrCat("READY=1\nSTATUS=", status.substr(0, status.find('\n'))).c_str());
}

void TellStopping() { sd_notify(0, "STOPPING=1"); }

int WaitForSignal(const sigset_t& signals, const std::function<void()>& prove_alive,
                  const std::function<bool()>& is_over) {
  const uint64_t limit_us = WatchdogMicroseconds();
  int received = 0;
  if (limit_us == 0 && !is_over) {
    sigwait(&signals, &received);
    return received;
  }
  uint64_t pause_us = limit_us == 0 ? kLookMicroseconds : limit_us / 2;
  if (is_over) pause_us = std::min(pause_us, kLookMicroseconds);
  const timespec pause = AsTimespec(pause_us);
  while (received <= 0) {
    if (is_over && is_over()) return 0;
    if (limit_us > 0) {
      prove_alive();
      sd_notify(0, "WATCHDOG=1");
    }
    received = sigtimedwait(&signals, nullptr, &pause);
  }
  return received;
}

}  // namespace rigcal

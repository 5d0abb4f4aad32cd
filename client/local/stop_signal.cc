// SPDX-License-Identifier: Apache-2.0
#include "client/local/stop_signal.h"

#include <poll.h>

#include <atomic>

namespace rigcal::client {
namespace {

std::atomic<int> received{0};
static_assert(std::atomic<int>::is_always_lock_free, "set inside a signal handler");

void Note(int signal) {
  int none = 0;
  received.compare_exchange_strong(none, signal);
}

}  // namespace

StopSignals::StopSignals() : before_{} {
  for (size_t i = 0; i < kSignals.size(); ++i) {
    struct sigaction action = {};
    action.sa_handler = Note;
    sigemptyset(&action.sa_mask);
    sigaction(kSignals[i], nullptr, &before_[i]);
    // nohup and background shells ignore signals on purpose.
    if (before_[i].sa_handler != SIG_IGN) sigaction(kSignals[i], &action, nullptr);
  }
}

StopSignals::~StopSignals() {
  for (size_t i = 0; i < kSignals.size(); ++i) sigaction(kSignals[i], &before_[i], nullptr);
}

void StopSignals::Sleep(std::chrono::milliseconds duration) const {
  poll(nullptr, 0, static_cast<int>(duration.count()));
}

int StopSignals::Received() { return received.load(); }

}  // namespace rigcal::client

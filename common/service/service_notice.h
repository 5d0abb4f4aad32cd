// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <signal.h>

#include <functional>
#include <string>

namespace rigcal {

// What a program that systemd has started as a service of Type=notify tells it (sd_notify(3)). A
// program that was started otherwise, without $NOTIFY_SOCKET, tells nobody; nothing here can fail.

// It does its work from now on. `status` is the line that `systemctl status` shows.
void TellReady(const std::string& status);

// It ends: what follows is no fault.
void TellStopping();

// Waits for one of the signals, which every thread must block, and returns its number. Where the
// unit has WatchdogSec=, calls `prove_alive` and tells systemd of it, at once and then twice in
// each such time; without it `prove_alive` is never called. `prove_alive` passes through the locks
// of the program's parts: where one of them hangs it hangs too, and systemd starts the program
// again.
//
// `is_over`, where it is set, is asked twice a second; true ends the wait with 0.
int WaitForSignal(const sigset_t& signals, const std::function<void()>& prove_alive,
                  const std::function<bool()>& is_over = {});

}  // namespace rigcal

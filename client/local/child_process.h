// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace rigcal::client {

struct ChildProcessOptions {
  std::string name;  // for messages: "agent of camera left"
  std::filesystem::path program;
  std::vector<std::string> arguments;  // without the program itself
  std::filesystem::path log;           // gets stdout and stderr
  // NAME=VALUE, added to the inherited environment or replacing parts of it.
  std::vector<std::string> environment = {};
};

// A program started by this one that does not outlive it: the kernel kills it when the thread that
// started it ends for any reason (so start children on the main thread). Signals go only to a
// process that has not been waited for, never to another one with the same id. For one thread.
//
// Not Boost.Process: its 1.74 leaves a zombie behind a failed exec, and the parent-death signal,
// the signal mask and the closing of descriptors would be the same code in its handlers.
class ChildProcess {
 public:
  // NOT_FOUND: no such program, or it cannot be run.  FAILED_PRECONDITION: no log, no process.
  static absl::StatusOr<ChildProcess> Start(ChildProcessOptions options);

  ChildProcess(ChildProcess&& other) noexcept;
  // Kills it where it still runs, and waits for it.
  ~ChildProcess();

  pid_t pid() const { return pid_; }
  const std::string& name() const { return options_.name; }

  // How it ended ("exited with code 3", "was ended by signal 9 (Killed)"); none while it runs.
  std::optional<std::string> Ended();
  // OK while it runs. ABORTED: how it ended, with the last lines of its log.
  absl::Status CheckRunning();

  // Asks it to end (SIGTERM) and returns at once.
  void RequestStop();
  // Waits until `deadline`, kills it if it has not ended by then, and waits for it.
  void Finish(std::chrono::steady_clock::time_point deadline);

  // The last lines of the log.
  std::string LogTail() const;

 private:
  ChildProcess(ChildProcessOptions options, pid_t pid) : options_(std::move(options)), pid_(pid) {}
  void Kill();

  ChildProcessOptions options_;
  pid_t pid_ = -1;
  std::optional<std::string> ended_;
};

}  // namespace rigcal::client

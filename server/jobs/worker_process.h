// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace rigcal::server {

// A child program with its standard output in a pipe. Killed and waited for when destroyed. One
// thread at a time.
class WorkerProcess {
 public:
  // `in` becomes its standard input; standard error is this process's.
  // $RIGCAL_CORRELATION_ID is the id of what the calling thread logs about. FAILED_PRECONDITION: it
  // cannot be started (names the program); RESOURCE_EXHAUSTED: no descriptors left.
  static absl::StatusOr<WorkerProcess> Start(const std::filesystem::path& program,
                                             const std::vector<std::string>& arguments, int in);
  WorkerProcess(WorkerProcess&& other) noexcept;
  WorkerProcess& operator=(WorkerProcess&&) = delete;
  ~WorkerProcess();

  pid_t pid() const { return pid_; }
  // What it has written, at most `size` bytes, waiting up to `limit`. Empty and `*ended`: it has
  // closed its output. Empty: nothing came.
  absl::StatusOr<std::string> Read(size_t size, std::chrono::milliseconds limit, bool* ended);
  void Kill();
  // Waits for its end and returns its status as waitpid gives it.
  int Wait();

 private:
  WorkerProcess(pid_t pid, int out) : pid_(pid), out_(out) {}

  pid_t pid_ = -1;  // -1: waited for
  int out_ = -1;
  int status_ = 0;
};

}  // namespace rigcal::server

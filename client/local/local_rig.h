// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "client/local/child_process.h"
#include "client/local/run_folder.h"

namespace rigcal::client {

// A camera of a local rig and its source.
struct LocalCamera {
  std::string name;
  std::string source;           // as behind `rigcal-agent --source`
  uint64_t expected_count = 0;  // of its observations; 0: not known
};

// A server and one agent per camera as processes of this machine, which end with this object.
// Used by the main thread.
class LocalRig {
 public:
  // The programs lie in `programs`; `folder` outlives this.
  LocalRig(std::filesystem::path programs, const RunFolder& folder)
      : programs_(std::move(programs)), folder_(folder) {}
  // Ends agents and server, and waits for them.
  ~LocalRig();
  LocalRig(const LocalRig&) = delete;
  LocalRig& operator=(const LocalRig&) = delete;

  // Starts the server on a free loopback port and waits until it accepts calls; an error of `wait`,
  // which is called between two polls and does CheckRunning, ends that. ABORTED: the server has
  // ended; with the last lines of its log. DEADLINE_EXCEEDED: it does not start.
  absl::Status StartServer(const std::function<absl::Status(std::chrono::milliseconds)>& wait);
  absl::Status StartAgents(const std::vector<LocalCamera>& cameras);

  // HOST:PORT, once the server has started.
  const std::string& address() const { return address_; }
  // OK while every process runs.
  absl::Status CheckRunning();
  // The last lines of the log of a camera's agent.
  std::string AgentLogTail(const std::string& camera) const;

 private:
  std::filesystem::path programs_;
  const RunFolder& folder_;
  std::vector<ChildProcess> server_;  // none or one
  std::vector<ChildProcess> agents_;
  std::string address_;
};

// The folder of this program.
absl::StatusOr<std::filesystem::path> ProgramDirectory();

}  // namespace rigcal::client

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace rigcal::testing {

// A program of this build, started with its output in files. Killed (by its id) with the object.
class Process {
 public:
  // Programs with the address sanitizer are several times as slow.
#ifdef __SANITIZE_ADDRESS__
  static constexpr std::chrono::seconds kLongestRun{400};
#else
  static constexpr std::chrono::seconds kLongestRun{100};
#endif

  struct Options {
    std::vector<std::string>
        arguments;  // [0]: name of a program in the build's bin folder, or a path
    std::map<std::string, std::string> environment;  // added to this process's
  };
  explicit Process(Options options);
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  pid_t pid() const { return pid_; }
  // Waits for its end; the exit code, or 128 + signal. Fails the test after `limit`.
  int Wait(std::chrono::seconds limit = kLongestRun);
  void Signal(int signal) const;
  bool Running();
  std::string StandardOutput() const;
  std::string StandardError() const;

 private:
  pid_t pid_ = -1;
  int exit_code_ = -1;
  bool ended_ = false;
  std::filesystem::path output_;
  std::filesystem::path error_;
};

struct CommandResult {
  int exit_code = 0;
  std::string output;
  std::string error;
};

// Runs a program of this build to its end.
CommandResult RunCommand(std::vector<std::string> arguments,
                         std::map<std::string, std::string> environment = {});

// Polls `condition` every few milliseconds until it holds; false after `limit`.
template <typename Condition>
bool WaitFor(Condition condition, std::chrono::seconds limit = std::chrono::seconds(60));

// Running processes with this text in their command line.
std::vector<pid_t> ProcessesWith(const std::string& text);

void SleepBriefly();

template <typename Condition>
bool WaitFor(Condition condition, std::chrono::seconds limit) {
  const auto deadline = std::chrono::steady_clock::now() + limit;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    SleepBriefly();
  }
  return true;
}

// A rigcal-server of this build on a free loopback port.
class ServerProcess {
 public:
  // `port` 0: any; `more` follows the other arguments. Waits until it serves.
  explicit ServerProcess(const std::filesystem::path& data_dir, int port = 0,
                         std::map<std::string, std::string> environment = {},
                         const std::vector<std::string>& more = {});

  const std::string& address() const { return address_; }
  int port() const { return port_; }
  Process& process() { return process_; }

 private:
  std::filesystem::path port_file_;
  Process process_;
  int port_ = 0;
  std::string address_;
};

}  // namespace rigcal::testing

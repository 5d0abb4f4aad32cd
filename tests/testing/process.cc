// SPDX-License-Identifier: Apache-2.0
#include "tests/testing/process.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <thread>
#include <utility>

namespace rigcal::testing {
namespace {

namespace fs = std::filesystem;

std::string ReadFile(const fs::path& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

fs::path NewFile(const char* what) {
  std::string name = (fs::temp_directory_path() / (std::string("rigcal-") + what + "-XXXXXX"));
  const int file = mkstemp(name.data());
  if (file < 0) throw std::runtime_error("cannot make " + name);
  close(file);
  return name;
}

std::string ProgramPath(const std::string& name) {
  return name.find('/') == std::string::npos ? std::string(RIGCAL_BIN_DIR) + "/" + name : name;
}

}  // namespace

Process::Process(Options options) : output_(NewFile("out")), error_(NewFile("err")) {
  options.arguments.at(0) = ProgramPath(options.arguments.at(0));
  std::vector<char*> arguments;
  for (std::string& argument : options.arguments) arguments.push_back(argument.data());
  arguments.push_back(nullptr);
  const pid_t parent = getpid();
  pid_ = fork();
  if (pid_ < 0) throw std::runtime_error("cannot fork");
  if (pid_ > 0) return;
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != parent) _exit(126);
  const int out = open(output_.c_str(), O_WRONLY | O_TRUNC);
  const int err = open(error_.c_str(), O_WRONLY | O_TRUNC);
  dup2(out, STDOUT_FILENO);
  dup2(err, STDERR_FILENO);
  for (const auto& [name, value] : options.environment) setenv(name.c_str(), value.c_str(), 1);
  execv(arguments[0], arguments.data());
  _exit(127);
}

Process::~Process() {
  if (Running()) {
    Signal(SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  std::error_code ignored;
  fs::remove(output_, ignored);
  fs::remove(error_, ignored);
}

bool Process::Running() {
  if (ended_) return false;
  int status = 0;
  const pid_t got = waitpid(pid_, &status, WNOHANG);
  if (got == 0) return true;
  ended_ = true;
  exit_code_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return false;
}

int Process::Wait(std::chrono::seconds limit) {
  if (!WaitFor([this] { return !Running(); }, limit)) {
    ADD_FAILURE() << "the process still runs after " << limit.count() << " s; its errors:\n"
                  << StandardError();
    return -1;
  }
  return exit_code_;
}

void Process::Signal(int signal) const {
  if (!ended_) kill(pid_, signal);
}

std::string Process::StandardOutput() const { return ReadFile(output_); }
std::string Process::StandardError() const { return ReadFile(error_); }

CommandResult RunCommand(std::vector<std::string> arguments,
                         std::map<std::string, std::string> environment) {
  Process process({std::move(arguments), std::move(environment)});
  CommandResult result;
  result.exit_code = process.Wait();
  result.output = process.StandardOutput();
  result.error = process.StandardError();
  return result;
}

void SleepBriefly() { std::this_thread::sleep_for(std::chrono::milliseconds(5)); }

std::vector<pid_t> ProcessesWith(const std::string& text) {
  std::vector<pid_t> found;
  for (const auto& entry : fs::directory_iterator("/proc")) {
    const std::string name = entry.path().filename();
    if (name.find_first_not_of("0123456789") != std::string::npos) continue;
    if (std::stoi(name) == getpid()) continue;
    // A process may end while this reads, which std::getline takes for the end of a file; iterators
    // of a stream throw.
    std::ifstream stream(entry.path() / "cmdline");
    std::string command;
    std::getline(stream, command);
    if (command.find(text) != std::string::npos) found.push_back(std::stoi(name));
  }
  return found;
}

ServerProcess::ServerProcess(const fs::path& data_dir, int port,
                             std::map<std::string, std::string> environment,
                             const std::vector<std::string>& more)
    : port_file_(NewFile("port")), process_([&] {
        Process::Options options{
            {"rigcal-server", "--listen", "127.0.0.1:" + std::to_string(port), "--data-dir",
             data_dir.string(), "--port-file", port_file_.string()},
            std::move(environment)};
        options.arguments.insert(options.arguments.end(), more.begin(), more.end());
        return options;
      }()) {
  const bool serves =
      WaitFor([this] { return !ReadFile(port_file_).empty() || !process_.Running(); });
  if (!serves || !process_.Running()) {
    throw std::runtime_error("rigcal-server does not serve: " + process_.StandardError());
  }
  port_ = std::stoi(ReadFile(port_file_));
  address_ = "127.0.0.1:" + std::to_string(port_);
  fs::remove(port_file_);
}

}  // namespace rigcal::testing

// SPDX-License-Identifier: Apache-2.0
#include "tests/testing/process_figures.h"

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace rigcal::testing {
namespace {

std::string ProcFolder(pid_t pid) { return "/proc/" + std::to_string(pid); }

// A line such as "VmRSS:   1234 kB".
double StatusFigureMb(pid_t pid, const std::string& name) {
  std::ifstream stream(ProcFolder(pid) + "/status");
  std::string word;
  while (stream >> word) {
    double kilobytes = 0;
    if (word == name + ":" && stream >> kilobytes) return kilobytes / 1024;
  }
  return 0;
}

}  // namespace

double MemoryMb(pid_t pid) { return StatusFigureMb(pid, "VmRSS"); }
double PeakMemoryMb(pid_t pid) { return StatusFigureMb(pid, "VmHWM"); }

int OpenDescriptors(pid_t pid) {
  std::error_code error;
  const std::filesystem::directory_iterator folder(ProcFolder(pid) + "/fd", error);
  if (error) return 0;
  return static_cast<int>(std::distance(begin(folder), end(folder)));
}

}  // namespace rigcal::testing

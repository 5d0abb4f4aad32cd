// SPDX-License-Identifier: Apache-2.0
#include "tests/testing/process_figures.h"

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
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

double CpuSeconds(pid_t pid) {
  std::ifstream stream(ProcFolder(pid) + "/stat");
  std::string text;
  std::getline(stream, text);
  const size_t name_end = text.rfind(')');
  if (name_end == std::string::npos) return 0;
  // Fields 14 and 15, counted after the parenthesised name.
  std::istringstream fields(text.substr(name_end + 2));
  std::string skipped;
  for (int i = 0; i < 11; ++i) fields >> skipped;
  double user = 0;
  double system = 0;
  fields >> user >> system;
  return (user + system) / static_cast<double>(sysconf(_SC_CLK_TCK));
}

int OpenDescriptors(pid_t pid) {
  std::error_code error;
  const std::filesystem::directory_iterator folder(ProcFolder(pid) + "/fd", error);
  if (error) return 0;
  return static_cast<int>(std::distance(begin(folder), end(folder)));
}

}  // namespace rigcal::testing

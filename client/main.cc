// SPDX-License-Identifier: Apache-2.0
#include <fcntl.h>
#include <signal.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <exception>
#include <iostream>
#include <string>
#include <vector>

#include "client/command_line.h"
#include "client/local/stop_signal.h"
#include "client/output/text_table.h"
#include "client/watch/terminal.h"

namespace {

// A closed standard descriptor would be given to the next file or connection, and our output would
// go there.
void HoldStandardDescriptors() {
  for (const int descriptor : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (fcntl(descriptor, F_GETFD) >= 0 || errno != EBADF) continue;
    // Read-only: writing to what was closed stays an error.
    if (open("/dev/null", O_RDONLY) < 0) return;
  }
}

int Finish(rigcal::client::ExitCode code, std::ostream& out,
           const rigcal::client::DescriptorBuffer& buffer) {
  out.flush();
  const int error = buffer.error_number();
  // A reader that has seen enough (head) is no fault.
  if (error == 0 || error == EPIPE) return static_cast<int>(code);
  std::cerr << "rigcal: cannot write to stdout: " << strerror(error) << std::endl;
  const bool ok = code == rigcal::client::ExitCode::kOk;
  return static_cast<int>(ok ? rigcal::client::ExitCode::kFailed : code);
}

// As if the signal had not been caught, now that everything is cleaned up: a shell's loop ends.
void DieOf(int signal) {
  ::signal(signal, SIG_DFL);
  raise(signal);
}

}  // namespace

int main(int argc, char** argv) {
  using namespace rigcal::client;
  HoldStandardDescriptors();
  ::signal(SIGPIPE, SIG_IGN);
  // An inherited SIG_IGN would take the children's exit codes from us.
  ::signal(SIGCHLD, SIG_DFL);

  DescriptorBuffer buffer(STDOUT_FILENO);
  std::ostream out(&buffer);
  Console console{.out = out, .err = std::cerr, .err_is_terminal = isatty(STDERR_FILENO) == 1};
  if (isatty(STDOUT_FILENO) == 1) {
    TextTable::FitTo(Terminal::ColumnsOfOutput());
    console.colour = Terminal::HasColour();
  }
  if (console.err_is_terminal && isatty(STDIN_FILENO) == 1) console.in = &std::cin;
  ExitCode code = ExitCode::kFailed;
  try {
    code =
        RunCommandLine(std::vector<std::string>(argv + (argc > 0 ? 1 : 0), argv + argc), console);
  } catch (const std::exception& error) {
    std::cerr << "rigcal: unexpected: " << error.what() << std::endl;
  }
  const int result = Finish(code, out, buffer);
  if (StopSignals::Received() != 0) DieOf(StopSignals::Received());
  return result;
}

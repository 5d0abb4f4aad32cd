// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sstream>
#include <string>
#include <vector>

#include "client/command_line.h"

namespace rigcal::testing {

struct CommandOutcome {
  int exit_code = -1;
  std::string out;
  std::string err;
};

// Runs what a user would type behind `rigcal`, in this process.
// `in`: where a person answers; null: nobody is there.
inline CommandOutcome Rigcal(const std::vector<std::string>& arguments,
                             std::istream* in = nullptr) {
  std::ostringstream out, err;
  client::Console console{.out = out, .err = err};
  console.in = in;
  CommandOutcome outcome;
  outcome.exit_code = static_cast<int>(client::RunCommandLine(arguments, console));
  outcome.out = out.str();
  outcome.err = err.str();
  return outcome;
}

}  // namespace rigcal::testing

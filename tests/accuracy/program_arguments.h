// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace rigcal::accuracy {

// What every program of tests/accuracy can be told.
struct ProgramArguments {
  int seeds = 100;
  int first_seed = 1;
  int threads = 2;
  int camera_count = 6;
  double duration_s = 40;
  bool verbose = false;  // a line for each seed
};

// Reads them, printing help or what is wrong; then `exit_code` is set and false comes back.
// `defaults` of this program; `about` in one line.
bool ReadArguments(int argc, char** argv, const std::string& about, ProgramArguments* arguments,
                   int* exit_code);

}  // namespace rigcal::accuracy

// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/program_arguments.h"

#include <CLI/CLI.hpp>

namespace rigcal::accuracy {

bool ReadArguments(int argc, char** argv, const std::string& about, ProgramArguments* arguments,
                   int* exit_code) {
  CLI::App app(about);
  app.option_defaults()->always_capture_default();
  app.add_option("--seeds", arguments->seeds, "number of seeds")->check(CLI::Range(1, 100000));
  app.add_option("--first-seed", arguments->first_seed, "the lowest")
      ->check(CLI::Range(0, 1 << 30));
  app.add_option("--threads", arguments->threads, "seeds at the same time")
      ->check(CLI::Range(1, 256));
  app.add_option("--cameras", arguments->camera_count, "of the simulated rig")
      ->check(CLI::Range(2, 100));
  app.add_option("--duration", arguments->duration_s, "of the wave, seconds")
      ->check(CLI::Range(1.0, 3600.0));
  app.add_flag("--verbose", arguments->verbose, "a line for each seed");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    const int code = app.exit(error);
    *exit_code = code == 0 ? 0 : 2;
    return false;
  }
  return true;
}

}  // namespace rigcal::accuracy

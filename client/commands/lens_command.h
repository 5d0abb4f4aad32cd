// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "client/commands/command_context.h"

namespace rigcal::client {

struct LensDiffOptions {
  std::string a, b;    // files of lenses
  std::string camera;  // of files with several; empty: that which is called like the file
};

// `rigcal lens diff`: how far two lenses of one camera are apart.
ExitCode CompareLensFiles(const LensDiffOptions& options, CommandContext& context);

struct LensGetOptions {
  std::string session;
  std::string camera;
  std::string output;  // the YAML; empty: none is written
  bool force = false;  // replace it
};

// `rigcal lens get`: the lens of a camera from the board that a session has seen, as the server
// makes it; waits for it.
ExitCode GetLens(const LensGetOptions& options, CommandContext& context);

struct LensUseOptions {
  std::string session;
  bool activate = false;
};

// `rigcal lens use`: calibrates a session with the lenses found in it, of those of its cameras that
// have none.
ExitCode UseLenses(const LensUseOptions& options, CommandContext& context);

}  // namespace rigcal::client

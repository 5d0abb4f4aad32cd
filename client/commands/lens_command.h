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

}  // namespace rigcal::client

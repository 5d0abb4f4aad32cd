// SPDX-License-Identifier: Apache-2.0
#include "agent/command/subcommands.h"

namespace rigcal::agent {

void Subcommands::AddTo(CLI::App& app) {
  app.require_subcommand(0, 1);
  AddSourcesCommand(app, out_, &chosen_);
  AddDetectCommand(app, out_, &chosen_);
  AddTuneCommand(app, out_, &chosen_);
  AddMaskCommand(app, out_, &chosen_);
  AddInfoCommand(app, out_, &chosen_);
  AddConvertCommand(app, out_, &chosen_);
  AddSimulateCommand(app, out_, &chosen_);
}

}  // namespace rigcal::agent

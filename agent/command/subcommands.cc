// SPDX-License-Identifier: Apache-2.0
#include "agent/command/subcommands.h"

namespace rigcal::agent {

void Subcommands::AddTo(CLI::App& app) {
  app.require_subcommand(0, 1);
  AddJoinCommand(app, this);
  AddSourcesCommand(app, this);
  AddDetectCommand(app, this);
  AddTuneCommand(app, this);
  AddMaskCommand(app, this);
  AddInfoCommand(app, this);
  AddConvertCommand(app, this);
  AddSimulateCommand(app, this);
}

}  // namespace rigcal::agent

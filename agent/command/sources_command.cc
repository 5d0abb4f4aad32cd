// SPDX-License-Identifier: Apache-2.0
#include <memory>
#include <string>

#include "agent/capture/registry/source_help.h"
#include "agent/command/subcommands.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

struct SourcesFlags {
  std::string kind;
  bool markdown = false;
};

absl::Status PrintSources(const SourcesFlags& flags, std::ostream& out) {
  if (flags.markdown) {
    out << SourcesMarkdown();
  } else if (flags.kind.empty()) {
    out << SourceSummaries() << "rigcal-agent sources KIND lists the options of a kind.\n";
  } else {
    RIGCAL_ASSIGN_OR_RETURN(const std::string help, SourceOptionsHelp(flags.kind));
    out << help;
  }
  return absl::OkStatus();
}

}  // namespace

void AddSourcesCommand(CLI::App& app, std::ostream& out, std::function<absl::Status()>* chosen) {
  CLI::App* const command =
      app.add_subcommand("sources", "Lists the kinds of camera sources and their options");
  const auto flags = std::make_shared<SourcesFlags>();
  command->add_option("KIND", flags->kind, "All options of this kind, such as csv");
  command->add_flag("--markdown", flags->markdown, "All kinds, as the page docs/sources.md");
  command->callback(
      [flags, chosen, &out] { *chosen = [flags, &out] { return PrintSources(*flags, out); }; });
}

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
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

void AddSourcesCommand(CLI::App& app, Subcommands* all) {
  const auto [command, flags] = all->Add(
      app, "sources", "Lists the kinds of camera sources and their options", &PrintSources);
  command.add_option("KIND", flags.kind, "All options of this kind, such as csv");
  command.add_flag("--markdown", flags.markdown, "All kinds, as the page docs/sources.md");
}

}  // namespace rigcal::agent

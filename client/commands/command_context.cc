// SPDX-License-Identifier: Apache-2.0
#include "client/commands/command_context.h"

#include <nlohmann/json.hpp>

namespace rigcal::client {

void PrintFiles(const char* kind, const std::string& id,
                const std::vector<std::filesystem::path>& files, CommandContext& context) {
  if (context.console.format == OutputFormat::kTable) {
    for (const std::filesystem::path& file : files) context.console.out << file.string() << "\n";
    return;
  }
  auto names = nlohmann::ordered_json::array();
  for (const std::filesystem::path& file : files) names.push_back(file.string());
  context.console.out << JsonText({{kind, id}, {"files", names}}) << "\n";
}

ExitCode Confirm(Console& console, const std::string& deed) {
  if (console.in == nullptr) {
    console.Message("to " + deed + " cannot be undone, and nobody can be asked here: add --yes");
    return ExitCode::kUsage;
  }
  console.err << Printable(deed) << "? It cannot be undone [y/N] " << std::flush;
  std::string answer;
  std::getline(*console.in, answer);
  if (answer == "y" || answer == "Y" || answer == "yes") return ExitCode::kOk;
  console.Message("nothing is deleted");
  return ExitCode::kFailed;
}

}  // namespace rigcal::client

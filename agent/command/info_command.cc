// SPDX-License-Identifier: Apache-2.0
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "agent/command/event_file_info.h"
#include "agent/command/subcommands.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

struct InfoFlags {
  std::string path;
  std::string geometry;
  std::string format = "table";
};

absl::StatusOr<std::optional<SensorGeometry>> ParseGeometry(const std::string& text) {
  if (text.empty()) return std::nullopt;
  const std::pair<std::string, std::string> sides = absl::StrSplit(text, absl::MaxSplits('x', 1));
  SensorGeometry geometry;
  if (absl::SimpleAtoi(sides.first, &geometry.width) &&
      absl::SimpleAtoi(sides.second, &geometry.height) && geometry.width >= 1 &&
      geometry.width <= 2048 && geometry.height >= 1 && geometry.height <= 2048) {
    return geometry;
  }
  return absl::InvalidArgumentError(
      absl::StrCat("--geometry ", text, " is not WIDTHxHEIGHT, such as 1280x720"));
}

absl::Status Info(const InfoFlags& flags, std::ostream& out) {
  RIGCAL_ASSIGN_OR_RETURN(const auto geometry, ParseGeometry(flags.geometry));
  const absl::StatusOr<EventFileInfo> info = ReadEventFileInfo(flags.path, geometry);
  if (!info.ok()) {
    // What is in the file is no fault of what was typed.
    return absl::FailedPreconditionError(std::string(info.status().message()));
  }
  out << (flags.format == "json" ? InfoJson(*info) : FormatInfo(*info));
  return absl::OkStatus();
}

}  // namespace

void AddInfoCommand(CLI::App& app, std::ostream& out, std::function<absl::Status()>* chosen) {
  CLI::App* const command =
      app.add_subcommand("info", "Tells what is in a RAW file of an event camera");
  const auto flags = std::make_shared<InfoFlags>();
  command->add_option("file", flags->path, "RAW file: EVT 2.0, 2.1 or 3.0")->required();
  command->add_option("--geometry", flags->geometry,
                      "WIDTHxHEIGHT of a sensor that the file does not tell");
  command->add_option("-o,--output", flags->format, "table or json [table]")
      ->check(CLI::IsMember({"table", "json"}));
  command->footer(
      "Examples:\n"
      "  rigcal-agent info rig/left.raw\n"
      "  rigcal-agent info old.raw --geometry 640x480 -o json\n"
      "Exit codes: 0 ok, whether the file has faults or not, 1 no RAW file, 2 usage.");
  command->callback(
      [flags, chosen, &out] { *chosen = [flags, &out] { return Info(*flags, out); }; });
}

}  // namespace rigcal::agent

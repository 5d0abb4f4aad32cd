// SPDX-License-Identifier: Apache-2.0
#include <string>

#include "agent/command/event_file_flags.h"
#include "agent/command/reading_line.h"
#include "agent/command/subcommands.h"
#include "agent/event_files/event_file_info.h"

namespace rigcal::agent {
namespace {

struct InfoFlags {
  std::string path;
  EventFileFlags file;
  std::string format = "table";
};

absl::Status Info(const InfoFlags& flags, std::ostream& out) {
  const absl::StatusOr<EventFileInfo> info = [&] {
    ReadingLine line;
    return ReadEventFileInfo(flags.path, flags.file.geometry, flags.file.plain,
                             [&line](uint64_t count) { line.ShowEvents(count); });
  }();
  if (!info.ok()) {
    // A fault of the file, not of the command line.
    return absl::FailedPreconditionError(std::string(info.status().message()));
  }
  out << (flags.format == "json" ? InfoJson(*info) : FormatInfo(*info));
  return absl::OkStatus();
}

}  // namespace

void AddInfoCommand(CLI::App& app, Subcommands* all) {
  const auto [command, flags] =
      all->Add(app, "info", "Prints the contents of an event recording", &Info);
  command
      .add_option("file", flags.path,
                  "RAW (EVT 2.0, 2.1, 3.0), HDF5 or CSV, the format is detected from the content")
      ->required();
  flags.file.AddTo(command);
  AddFormatOption(command, &flags.format, "table or json [table]");
  AddFormerOption(&command, "--output", "-o table|json, or --output-format");
  command.footer(
      "Examples:\n"
      "  rigcal-agent info rig/left.raw\n"
      "  rigcal-agent info old.raw --geometry 640x480 -o json\n"
      "  rigcal-agent info events.txt --columns txyp --time s\n"
      "Exit codes: 0 ok, whether the file has faults or not, 1 no file of events, 2 usage.");
}

}  // namespace rigcal::agent

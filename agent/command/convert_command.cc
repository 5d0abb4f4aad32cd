// SPDX-License-Identifier: Apache-2.0
#include <string>

#include "absl/strings/str_cat.h"
#include "agent/command/event_file_flags.h"
#include "agent/command/reading_line.h"
#include "agent/command/subcommands.h"
#include "agent/event_files/event_conversion.h"
#include "agent/event_files/event_file_writer.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

struct ConvertFlags {
  std::string in, out;
  std::string layout = "compound";
  std::string raw = "evt3";
  bool force = false;
  EventFileFlags file;
};

void AppendCount(uint64_t count, const std::string& what, std::string* text) {
  if (count > 0) absl::StrAppend(text, "  ", count, " ", what, "\n");
}

std::string FormatSummary(const ConvertFlags& flags, const ConversionSummary& summary) {
  std::string text = absl::StrCat(flags.in, " -> ", flags.out, ": ", summary.cd_events, " events, ",
                                  summary.trigger_events, " triggers\n");
  const EventFaults& faults = summary.faults;
  AppendCount(faults.unknown_words, "damaged words or rows left out", &text);
  AppendCount(faults.outside_geometry, "events outside of the sensor left out", &text);
  AppendCount(faults.before_time, "events ahead of the first time left out", &text);
  AppendCount(faults.time_steps_back, "times the sensor's clock began anew", &text);
  AppendCount(faults.truncated_bytes, "bytes behind the last whole word left out", &text);
  for (const Refusal& refusal : summary.refused) {
    AppendCount(refusal.count, absl::StrCat("lines left out, the first one ", refusal.example),
                &text);
  }
  AppendCount(summary.losses.triggers, "triggers left out: the new format has no place for them",
              &text);
  AppendCount(summary.losses.moved_events,
              "events moved by up to 1 ms: they stood out of order in time", &text);
  return text;
}

absl::Status Convert(const ConvertFlags& flags, std::ostream& out) {
  RIGCAL_RETURN_IF_ERROR(CheckEventFileEnding(flags.out));
  const auto summary = [&] {
    ReadingLine line;
    return ConvertEventFile({.in = flags.in,
                             .out = flags.out,
                             .geometry = flags.file.geometry,
                             .plain = flags.file.plain,
                             .layout = flags.layout,
                             .raw = flags.raw == "evt2" ? EventFormat::kEvt2 : EventFormat::kEvt3,
                             .force = flags.force,
                             .on_read = [&line](uint64_t count) { line.ShowEvents(count); }});
  }();
  if (!summary.ok()) {
    // A fault of the file, not of the command line.
    return absl::FailedPreconditionError(std::string(summary.status().message()));
  }
  out << FormatSummary(flags, *summary);
  return absl::OkStatus();
}

}  // namespace

void AddConvertCommand(CLI::App& app, Subcommands* all) {
  const auto [command, flags] =
      all->Add(app, "convert", "Writes a file of events in another format", &Convert);
  command
      .add_option("in", flags.in,
                  "RAW (EVT 2.0, 2.1, 3.0), HDF5 or CSV, the format is detected from the content")
      ->required();
  command
      .add_option("out", flags.out,
                  "New file; its ending names the format: .raw, .csv, .h5 or .hdf5")
      ->required();
  flags.file.AddTo(command);
  command
      .add_option("--layout", flags.layout,
                  "Of HDF5: compound (/CD/events, with triggers) or events (/events/x, y, p, t, "
                  "without) [compound]")
      ->check(CLI::IsMember({"compound", "events"}));
  command.add_option("--raw", flags.raw, "Of .raw: evt3 (EVT 3.0) or evt2 (EVT 2.0) [evt3]")
      ->check(CLI::IsMember({"evt2", "evt3"}));
  command.add_flag("--force", flags.force, "Replace a file that is there");
  command.footer(
      "Examples:\n"
      "  rigcal-agent convert left.raw left.h5\n"
      "  rigcal-agent convert events.csv left.raw --geometry 640x480 --time s\n"
      "Triggers are kept, except in CSV and in --layout events. Everything left out is printed.\n"
      "Exit codes: 0 ok, 1 failed, 2 usage.");
}

}  // namespace rigcal::agent

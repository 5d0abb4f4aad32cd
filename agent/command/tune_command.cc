// SPDX-License-Identifier: Apache-2.0
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "agent/command/frame_input.h"
#include "agent/command/subcommands.h"
#include "agent/detect/frame/colour_tuning.h"
#include "common/file/durable_file.h"
#include "common/file/may_write.h"
#include "common/status/status_macros.h"
#include "common/target/target.h"

namespace rigcal::agent {
namespace {

struct TuneFlags {
  FrameInput input;
  std::string target;
  std::string out;
  bool force = false;
  uint64_t frames = 50;
  std::string format = "table";
};

absl::StatusOr<TunedColour> LearnColour(const TuneFlags& flags) {
  RIGCAL_ASSIGN_OR_RETURN(const Target target, ParseTarget(flags.target));
  RIGCAL_RETURN_IF_ERROR(CheckIsLine(target));
  RIGCAL_ASSIGN_OR_RETURN(const auto spec, ResolveFrameInput(flags.input));
  RIGCAL_ASSIGN_OR_RETURN(const std::unique_ptr<FrameSource> frames, spec->Make());
  RIGCAL_ASSIGN_OR_RETURN(ColourTuner tuner, ColourTuner::Create(target, frames->description()));
  RIGCAL_RETURN_IF_ERROR(frames->Start(target));
  for (uint64_t i = 0; flags.frames == 0 || i < flags.frames; ++i) {
    RIGCAL_ASSIGN_OR_RETURN(const std::optional<Frame> frame, frames->Next());
    if (!frame) break;
    RIGCAL_RETURN_IF_ERROR(tuner.Add(frame->image));
  }
  return tuner.Result();
}

// TOML to paste into a configuration, with the same options of a SPEC as its comment.
std::string Snippet(const ColourRange& colour) {
  std::string spec;
  std::string toml;
  const auto add = [&](std::string_view key, const std::string& value) {
    absl::StrAppend(&spec, ";", std::string(key), "=", value);
    absl::StrAppend(&toml, std::string(key), " = ", value, "\n");
  };
  add("hue_min", absl::StrFormat("%.1f", colour.hue_min_deg));
  add("hue_max", absl::StrFormat("%.1f", colour.hue_max_deg));
  add("saturation_min", absl::StrFormat("%.3f", colour.saturation_min));
  add("value_min", absl::StrCat(colour.value_min));
  add("washed_out_min", absl::StrCat(colour.washed_out_min));
  return absl::StrCat("# Behind --source: ", spec, "\n[camera.detector]\n", toml);
}

std::string TunedJson(const TunedColour& tuned) {
  const ColourRange& colour = tuned.colour;
  const nlohmann::ordered_json json = {
      {"pictures", tuned.frames},
      {"wands", tuned.wands},
      {"median",
       {{"hue_deg", tuned.hue_deg}, {"saturation", tuned.saturation}, {"value", tuned.value}}},
      {"detector",
       {{"hue_min", colour.hue_min_deg},
        {"hue_max", colour.hue_max_deg},
        {"saturation_min", colour.saturation_min},
        {"value_min", colour.value_min},
        {"washed_out_min", colour.washed_out_min}}}};
  return json.dump(2) + "\n";
}

absl::Status Tune(const TuneFlags& flags, std::ostream& out) {
  if (!flags.out.empty()) RIGCAL_RETURN_IF_ERROR(CheckOutputFile(flags.out, flags.force));
  RIGCAL_ASSIGN_OR_RETURN(const TunedColour tuned, LearnColour(flags));
  const std::string snippet = Snippet(tuned.colour);
  if (!flags.out.empty()) RIGCAL_RETURN_IF_ERROR(WriteOutputFile(flags.out, snippet));
  if (flags.format == "json") {
    out << TunedJson(tuned);
    return absl::OkStatus();
  }
  out << absl::StrFormat(
             "# The wand was found in %d of %d frames; median colour: hue %.0f deg, "
             "saturation %.2f, value %.0f\n",
             tuned.wands, tuned.frames, tuned.hue_deg, tuned.saturation, tuned.value)
      << snippet;
  return absl::OkStatus();
}

}  // namespace

void AddTuneCommand(CLI::App& app, Subcommands* all) {
  const auto [command, flags] =
      all->Add(app, "tune", "Learns the wand's colour from frames that show it", &Tune);
  AddFrameInput(command, &flags.input);
  command.add_option("--target", flags.target, "wand:0,0.13,0.39;diameter=0.04;hz=500")->required();
  AddOutputOption(command, &flags.out, &flags.force,
                  "File for the TOML to paste into a configuration");
  command.add_option("--pictures", flags.frames, "Frames to use at most; 0: all [50]");
  AddFormatOption(command, &flags.format, "table (TOML to paste) or json [table]");
  command.footer(
      "Hold the wand in front of the camera, near and far. Example:\n"
      "  rigcal-agent tune aravis:192.168.1.5 --target wand:0,0.13,0.39 >> agent.toml\n"
      "Exit codes: 0 ok, 1 failed (the wand was not found), 2 usage.");
}

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
#include "client/local/local_plan.h"

#include <algorithm>
#include <system_error>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/options/option_table.h"
#include "common/status/status_macros.h"

namespace rigcal::client {
namespace {

namespace fs = std::filesystem;

bool CarriesSeparator(const fs::path& path) { return path.string().find(';') != std::string::npos; }

absl::StatusOr<fs::path> ReachableFolder(const fs::path& folder, const fs::path& link_in) {
  if (!CarriesSeparator(folder)) return folder;
  const fs::path link = link_in / "recording";
  if (CarriesSeparator(link)) {
    return absl::InvalidArgumentError(
        absl::StrCat("the path ", folder.string(), " has a ';' in it, and so has ",
                     link_in.string(), ", through which it could be reached; rename one"));
  }
  std::error_code error;
  fs::create_directory_symlink(folder, link, error);
  if (error) {
    return absl::FailedPreconditionError(
        absl::StrCat("the path ", folder.string(), " has a ';' in it, and a link ", link.string(),
                     " to it cannot be made: ", error.message()));
  }
  return link;
}

const char* SourceOf(RecordingKind kind) {
  switch (kind) {
    case RecordingKind::kMarkers:
      return "csv";
    case RecordingKind::kEvents:
      return "raw";
    case RecordingKind::kImages:
      return "images";
    case RecordingKind::kVideo:
      return "video";
  }
  return "csv";
}

// Options in an agent's notation, without `seed`, which the world's options have already.
void AppendParts(const std::string& parts, std::string* options) {
  for (const auto part : absl::StrSplit(parts, ';', absl::SkipEmpty())) {
    if (!absl::StartsWith(part, "seed=")) absl::StrAppend(options, ";", part);
  }
}

// A camera's own options, after those of the world.
std::string OptionsOf(const SimulatedRigOptions& rig, bool events) {
  std::string options = FormatSimulationOptions(rig.world);
  if (!rig.frames) return options;
  absl::StrAppend(&options, events ? ";events=1" : ";pixels=1");
  AppendParts(FormatOptions(*rig.frames), &options);
  if (!events) return options;
  AppendParts(FormatOptions(rig.sensors), &options);
  absl::StrAppend(&options, ";output=", rig.output_hz);
  if (!rig.event_clock.empty()) absl::StrAppend(&options, ";clock=", rig.event_clock);
  return options;
}

}  // namespace

absl::StatusOr<LocalPlan> PlanRecorded(const RecordedFolder& folder, const std::string& speed,
                                       const RecordingOptionTexts& options,
                                       const fs::path& link_in) {
  RIGCAL_ASSIGN_OR_RETURN(const fs::path reachable, ReachableFolder(folder.path, link_in));
  LocalPlan plan;
  for (const RecordedCamera& camera : folder.cameras) {
    // The name first, so that a '=' in the path does not end one.
    std::string source =
        absl::StrCat(camera.camera, "=", SourceOf(camera.kind), ":",
                     (reachable / camera.recording.filename()).string(), ";speed=", speed);
    if (camera.kind == RecordingKind::kEvents && !options.events.empty()) {
      absl::StrAppend(&source, ";", options.events);
    }
    if (camera.IsFrames() && !options.frames.empty()) absl::StrAppend(&source, ";", options.frames);
    plan.cameras.push_back({camera.camera, std::move(source), 0});
  }
  const bool has_events =
      std::ranges::count(folder.cameras, RecordingKind::kEvents, &RecordedCamera::kind) > 0;
  if (!options.events.empty() && !has_events) {
    return absl::InvalidArgumentError(
        absl::StrCat("\"", options.events, "\" is for recordings of events, and there is none in ",
                     folder.path.string()));
  }
  if (!options.frames.empty() && std::ranges::none_of(folder.cameras, &RecordedCamera::IsFrames)) {
    return absl::InvalidArgumentError(
        absl::StrCat("\"", options.frames, "\" is for images and videos, and there are none in ",
                     folder.path.string()));
  }
  return plan;
}

absl::StatusOr<LocalPlan> PlanSimulated(const SimulatedRigOptions& rig, const Target& target,
                                        const std::string& speed, const std::string& lenses) {
  namespace fs = std::filesystem;
  LocalPlan plan;
  plan.duration_s = rig.world.duration_s;
  RIGCAL_ASSIGN_OR_RETURN(plan.world, SimulatedWorld::Create(rig.world, target));
  const size_t first_event_camera =
      plan.world->cameras().size() - static_cast<size_t>(rig.event_cameras);
  for (size_t i = 0; i < plan.world->cameras().size(); ++i) {
    const std::string& name = plan.world->cameras()[i].description.camera;
    const bool events = i >= first_event_camera;
    const double count =
        events ? rig.output_hz * rig.world.duration_s : plan.world->FrameCount(static_cast<int>(i));
    std::string source =
        absl::StrCat(name, "=sim:camera=", i, ";", OptionsOf(rig, events), ";speed=", speed);
    if (!lenses.empty()) {
      const std::string file = fs::absolute(fs::path(lenses) / (name + ".yaml")).string();
      if (!fs::exists(file)) {
        return absl::NotFoundError(
            absl::StrCat("--lenses: there is no ", file, " for the simulated camera ", name));
      }
      absl::StrAppend(&source, ";calibration=", file);
    }
    plan.cameras.push_back({name, std::move(source), static_cast<uint64_t>(count)});
  }
  return plan;
}

}  // namespace rigcal::client

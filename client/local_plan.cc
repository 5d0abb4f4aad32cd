// SPDX-License-Identifier: Apache-2.0
#include "client/local_plan.h"

#include <system_error>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
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

// `seed` belongs to both, and the world's stands there already.
std::string WithPictures(std::string options, const char* kind,
                         const FrameRenderOptions& pictures) {
  absl::StrAppend(&options, ";", kind, "=1");
  for (const auto part :
       absl::StrSplit(FormatFrameRenderOptions(pictures), ';', absl::SkipEmpty())) {
    if (!absl::StartsWith(part, "seed=")) absl::StrAppend(&options, ";", part);
  }
  return options;
}

}  // namespace

absl::StatusOr<LocalPlan> PlanRecorded(const RecordedFolder& folder, const std::string& speed,
                                       const fs::path& link_in) {
  RIGCAL_ASSIGN_OR_RETURN(const fs::path reachable, ReachableFolder(folder.path, link_in));
  LocalPlan plan;
  for (const RecordedCamera& camera : folder.cameras) {
    // The name in front, so that a '=' in the path is not taken for the end of one.
    plan.cameras.push_back(
        {camera.camera,
         absl::StrCat(camera.camera, "=csv:", (reachable / camera.csv.filename()).string(),
                      ";speed=", speed)});
  }
  return plan;
}

absl::StatusOr<LocalPlan> PlanSimulated(const SimulatedRigOptions& rig, const Target& target,
                                        const std::string& speed) {
  LocalPlan plan;
  RIGCAL_ASSIGN_OR_RETURN(plan.world, SimulatedWorld::Create(rig.world, target));
  const std::string options = FormatSimulationOptions(rig.world);
  const size_t first_event_camera =
      plan.world->cameras().size() - static_cast<size_t>(rig.event_cameras);
  for (size_t i = 0; i < plan.world->cameras().size(); ++i) {
    const std::string& name = plan.world->cameras()[i].description.camera;
    const std::string its_options =
        rig.pictures
            ? WithPictures(options, i < first_event_camera ? "pixels" : "events", *rig.pictures)
            : options;
    plan.cameras.push_back(
        {name, absl::StrCat(name, "=sim:camera=", i, ";", its_options, ";speed=", speed)});
  }
  return plan;
}

}  // namespace rigcal::client

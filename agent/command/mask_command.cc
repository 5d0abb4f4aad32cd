// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "agent/capture/static_mask.h"
#include "agent/command/frame_input.h"
#include "agent/command/subcommands.h"
#include "agent/detect/frame/wand_detector.h"
#include "common/file/may_write.h"
#include "common/status/status_macros.h"
#include "common/target/target.h"

namespace rigcal::agent {
namespace {

constexpr double kMuch = 0.1;    // of the picture
constexpr int kMostHidden = 10;  // a wand that moves may pass a lamp: one marker of so many

struct MaskFlags {
  FrameInput input;
  std::string out;
  bool force = false;
  std::string target = "wand:0,0.13,0.39";
  uint64_t frames = 100;
  std::string format = "table";
};

absl::Status LearnMask(const MaskFlags& flags, std::ostream& out) {
  RIGCAL_ASSIGN_OR_RETURN(const Target target, ParseTarget(flags.target));
  RIGCAL_RETURN_IF_ERROR(CheckIsLine(target));
  RIGCAL_RETURN_IF_ERROR(CheckOutputFile(flags.out, flags.force));
  RIGCAL_ASSIGN_OR_RETURN(const auto spec, ResolveFrameInput(flags.input));
  RIGCAL_ASSIGN_OR_RETURN(const std::unique_ptr<FrameSource> frames, spec->Make());
  RIGCAL_ASSIGN_OR_RETURN(StaticMaskLearner learner,
                          StaticMaskLearner::Create(spec->detecting.detector.colour,
                                                    frames->description().image_size_px));
  RIGCAL_ASSIGN_OR_RETURN(
      WandDetector detector,
      WandDetector::Create(spec->detecting.detector, target, frames->description()));
  std::vector<Eigen::Vector2d> seen_px;  // markers of wands
  int wand_count = 0;
  RIGCAL_RETURN_IF_ERROR(frames->Start(target));
  for (uint64_t i = 0; flags.frames == 0 || i < flags.frames; ++i) {
    RIGCAL_ASSIGN_OR_RETURN(const std::optional<Frame> frame, frames->Next());
    if (!frame) break;
    learner.Add(frame->image);
    RIGCAL_ASSIGN_OR_RETURN(const Detection detection,
                            detector.Detect(frame->image, frame->time_ns, frame->clock_epoch));
    wand_count += detection.outcome == DetectionOutcome::kWand ? 1 : 0;
    for (const MarkerObservation& marker : detection.observation.markers) {
      if (marker.visible) seen_px.push_back(marker.centre_px);
    }
  }
  if (learner.frame_count() == 0) {
    return absl::FailedPreconditionError("there were no frames to learn from");
  }
  const PixelMask mask = learner.Learn();
  const auto hidden = std::ranges::count_if(seen_px, [&](const Eigen::Vector2d& centre_px) {
    return mask.Get(static_cast<int>(std::lround(centre_px.x())),
                    static_cast<int>(std::lround(centre_px.y())));
  });
  if (kMostHidden * hidden > static_cast<int64_t>(seen_px.size())) {
    return absl::FailedPreconditionError(
        absl::StrCat("the wand was seen in ", wand_count, " of ", learner.frame_count(),
                     " frames, and the mask "
                     "would hide ",
                     hidden, " of its ", seen_px.size(),
                     " markers. Take the wand out of the "
                     "picture, or do without a mask: what stands still is ignored after 3 s anyway "
                     "(background=3)"));
  }
  RIGCAL_RETURN_IF_ERROR(WriteMask(mask, flags.out));
  const int64_t ignored = mask.CountPixels();
  const double share = static_cast<double>(ignored) / (1.0 * mask.width() * mask.height());
  if (flags.format == "json") {
    const nlohmann::ordered_json json = {{"pictures", learner.frame_count()},
                                         {"ignored_pixels", ignored},
                                         {"ignored_share", share},
                                         {"mask", flags.out}};
    out << json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) << "\n";
    return absl::OkStatus();
  }
  out << absl::StrCat("learned from ", learner.frame_count(), " frames to ignore ", ignored,
                      " pixels (", absl::StrFormat("%.3g", share * 100), " %)\n",
                      share > kMuch
                          ? "That is much: a wand in front of it is not seen. What stands "
                            "still is ignored after 3 s without a mask, too\n"
                          : "",
                      "\n[camera.detector]\nmask = \"", flags.out, "\"\n");
  return absl::OkStatus();
}

}  // namespace

void AddMaskCommand(CLI::App& app, Subcommands* all) {
  const auto [command, flags] =
      all->Add(app, "mask", "Learns static bright spots for the detector to ignore", &LearnMask);
  AddFrameInput(command, &flags.input);
  AddOutputOption(command, &flags.out, &flags.force,
                  "Image of the camera's size, white where to ignore")
      ->required();
  command.add_option("--target", flags.target, "Target of a simulated camera");
  command.add_option("--pictures", flags.frames, "Frames to use at most; 0: all [100]");
  AddFormatOption(command, &flags.format, "table or json [table]");
  command.footer(
      "Point the camera at the room without the wand, or with a moving one. Example:\n"
      "  rigcal-agent mask aravis:192.168.1.5 --output left_mask.png\n"
      "Exit codes: 0 ok, 1 failed, 2 usage.");
}

}  // namespace rigcal::agent

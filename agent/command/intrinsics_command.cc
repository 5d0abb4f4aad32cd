// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <filesystem>
#include <memory>
#include <set>
#include <string>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "agent/capture/event_source_spec.h"
#include "agent/capture/image_file.h"
#include "agent/capture/recorded/raw_event_source.h"
#include "agent/capture/recorded/recorded_frame_source.h"
#include "agent/command/board_pictures.h"
#include "agent/command/board_views.h"
#include "agent/command/corner_file.h"
#include "agent/command/frame_input.h"
#include "agent/command/lens_map.h"
#include "agent/command/lens_report.h"
#include "agent/command/subcommands.h"
#include "common/board/board.h"
#include "common/camera/camera_export.h"
#include "common/file/durable_file.h"
#include "common/file/may_write.h"
#include "common/lens/lens_advice.h"
#include "common/lens/lens_guide.h"
#include "common/lens/lens_solver.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

namespace fs = std::filesystem;

constexpr int kViewsOfStream = 40;
constexpr double kUntilPx = 0.2;  // of a live camera

struct IntrinsicsFlags {
  FrameInput input;
  std::string board;
  std::string out;
  bool force = false;
  std::string corners;  // file for the points that were found; empty: none
  std::string model = "auto";
  int views = -1;        // not given
  double until_px = -1;  // not given
  std::string map;
  bool keep_poor = false;
  std::string format = "table";
};

// The files to write: none twice, none that is there already.
absl::Status CheckOutputs(const IntrinsicsFlags& flags) {
  std::set<fs::path> paths;
  for (const auto& [option, file] :
       {std::pair("--output", &flags.out), std::pair("--map", &flags.map),
        std::pair("--corners", &flags.corners)}) {
    if (file->empty()) continue;
    if (!paths.insert(fs::absolute(*file).lexically_normal()).second) {
      return absl::InvalidArgumentError(
          absl::StrCat(option, " ", *file, ": another option writes this file"));
    }
    if (const absl::Status status = CheckOutputFile(*file, flags.force); !status.ok()) {
      return absl::Status(status.code(), absl::StrCat(option, ": ", std::string(status.message())));
    }
  }
  if (!flags.map.empty() && fs::path(flags.map).extension() != ".png") {
    return absl::InvalidArgumentError(
        absl::StrCat("--map ", flags.map, ": it is a PNG: name it .png"));
  }
  return absl::OkStatus();
}

// Images that somebody has chosen, as opposed to a camera or a video.
bool IsPictures(const FrameInput& input) {
  std::error_code error;
  return fs::is_directory(input.input, error) || IsImageName(input.input);
}

// The lens is what is asked for, and when the pictures were taken does not matter.
FrameInput WithoutLens(FrameInput input) {
  if (!input.config.empty()) return input;
  const bool says_lens = absl::StrContains(input.input, "calibration=");
  std::error_code error;
  const bool is_path = fs::exists(input.input, error);
  // A simulated camera knows its lens and takes no file.
  if (input.calibration.empty() && !says_lens && !absl::StrContains(input.input, "sim:")) {
    input.calibration = "none";
  }
  if (is_path && IsPictures(input) && input.fps.empty()) input.fps = "10";
  return input;
}

// What shows the board.
struct BoardSource {
  std::unique_ptr<BoardPictures> pictures;
  bool is_live = false;  // it shows what somebody does now
};

template <typename RecordedOptions>
bool IsLive(const SourceSpec& spec) {
  return dynamic_cast<const HasOptions<RecordedOptions>*>(&spec) == nullptr;
}

absl::StatusOr<BoardSource> SourceOf(const Board& board, const FrameInput& input) {
  RIGCAL_ASSIGN_OR_RETURN(const std::unique_ptr<SourceSpec> spec, ResolveInput(WithoutLens(input)));
  BoardSource source;
  if (const auto* const frames = dynamic_cast<const FrameSourceSpec*>(spec.get())) {
    RIGCAL_ASSIGN_OR_RETURN(auto made, frames->Make());
    source.pictures = PicturesOfFrames(board, std::move(made));
    source.is_live = IsLive<RecordedFramesOptions>(*spec);
    return source;
  }
  if (const auto* const events = dynamic_cast<const EventSourceSpec*>(spec.get())) {
    RIGCAL_ASSIGN_OR_RETURN(auto made, events->Make());
    RIGCAL_ASSIGN_OR_RETURN(source.pictures, PicturesOfEvents(board, std::move(made)));
    source.is_live = IsLive<RawSourceOptions>(*spec);
    return source;
  }
  return absl::InvalidArgumentError(
      absl::StrCat("camera ", spec->camera(),
                   " yields neither frames nor events; a simulated camera does with ;pixels=1"));
}

// What to hold where, and how much is known; a line after each view.
std::string GuideLine(const LensGuide& guide, size_t views, int views_at_most) {
  std::string line = absl::StrCat("view ", views);
  if (views_at_most > 0) absl::StrAppend(&line, " of ", views_at_most);
  if (guide.solution()) {
    absl::StrAppendFormat(&line, ": 95 %% of the image are known within %.2f px",
                          guide.solution()->uncertainty.p95_px);
  }
  if (guide.is_enough()) return line + ", which is enough\n";
  absl::StrAppend(&line, "\n  next: ", guide.next().words);
  if (std::isfinite(guide.next().expected_p95_px)) {
    absl::StrAppendFormat(&line, ", for %.2f px", guide.next().expected_p95_px);
  }
  return line + "\n";
}

// With what was left aside, which may be why.
absl::Status WithOthers(const BoardViews& views, const absl::Status& failed) {
  std::string text(failed.message());
  if (views.alike > 0) {
    absl::StrAppend(&text, "; ", views.alike, " more show it exactly as another one does");
  }
  for (const Refusal& refusal : views.refused) {
    absl::StrAppend(&text, "; ", refusal.count, refusal.count == 1 ? " was" : " were",
                    " not read: ", refusal.example);
  }
  return absl::Status(failed.code(), text);
}

absl::Status CalibrateLens(const IntrinsicsFlags& flags, std::ostream& out) {
  RIGCAL_ASSIGN_OR_RETURN(const Board board, ParseBoard(flags.board));
  LensOptions options;
  if (flags.model != "auto") {
    RIGCAL_ASSIGN_OR_RETURN(options.model, ParseLensModel(flags.model));
  }
  const bool is_table = flags.format == "table";
  const bool is_pictures = IsPictures(flags.input);
  BoardViewsOptions collecting;
  collecting.only_different = !is_pictures;
  collecting.views = flags.views >= 0 ? flags.views : is_pictures ? 0 : kViewsOfStream;
  if (collecting.views > 0 && collecting.views < kLeastLensViews) {
    return absl::InvalidArgumentError(absl::StrCat("--views ", collecting.views,
                                                   " are too few: ", kLeastLensViews,
                                                   " are the least, 20 to 40 are good"));
  }
  if (std::isnan(flags.until_px)) {
    return absl::InvalidArgumentError("--until-px must be a number of pixels");
  }
  if (is_pictures && flags.until_px >= 0) {
    return absl::InvalidArgumentError(
        "--until-px is of a camera or a video; of pictures all are used");
  }
  RIGCAL_RETURN_IF_ERROR(CheckOutputs(flags));
  if (!flags.corners.empty() && board.IsTwoSided()) {
    return absl::InvalidArgumentError(
        absl::StrCat("--corners: mrcal knows no boards with two sides; give the front alone, ",
                     FormatBoard(board.OneSide())));
  }
  RIGCAL_ASSIGN_OR_RETURN(const BoardSource source, SourceOf(board, flags.input));
  LensGuideOptions guiding;
  guiding.model = options.model;
  guiding.until_px = flags.until_px >= 0 ? flags.until_px : source.is_live ? kUntilPx : 0;
  guiding.is_whole = !board.HasMarkers();  // of those with markers, parts are found
  LensGuide guide(board.OneSide().Points(), source.pictures->description().image_size_px, guiding);
  if (is_table && !is_pictures) {
    out << absl::StrCat("first: ", guide.next().words, " (left and right as in the image)\n")
        << std::flush;
  }
  const auto follow = [&](const BoardViews& so_far) {
    if (is_pictures) return true;
    guide.Follow(so_far.views);
    if (is_table) {
      out << GuideLine(guide, so_far.views.size(), collecting.views) << std::flush;
    }
    return !guide.is_enough();
  };
  RIGCAL_ASSIGN_OR_RETURN(const BoardViews views,
                          CollectBoardViews(board, collecting, source.pictures.get(), follow));
  if (!flags.corners.empty()) {
    RIGCAL_RETURN_IF_ERROR(WriteOutputFile(flags.corners, CornersText(board, views)));
  }
  absl::StatusOr<LensSolution> solved =
      guide.is_enough() ? *guide.solution() : SolveLens(views.views, views.image_size_px, options);
  if (!solved.ok()) return WithOthers(views, solved.status());
  LensSolution solution = *std::move(solved);
  if (guiding.until_px > 0 && !guide.is_enough()) {
    solution.advice.push_back(absl::StrFormat(
        "95 %% of the image are known within %.2f px after %d views, not within the %g px of "
        "--until-px: %s",
        solution.uncertainty.p95_px, solution.views, guiding.until_px, guide.next().words));
  }
  if (!flags.map.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(const std::string map, DrawLensMap(views, solution));
    RIGCAL_RETURN_IF_ERROR(WriteOutputFile(flags.map, map));
  }
  const std::string why_not = WhyNotToUse(solution);
  const bool is_kept = why_not.empty() || flags.keep_poor;
  if (is_kept) {
    RIGCAL_RETURN_IF_ERROR(WriteCameraExport(flags.out, {.camera = views.camera,
                                                         .image_size_px = views.image_size_px,
                                                         .intrinsics = solution.intrinsics,
                                                         .cam_from_rig = std::nullopt}));
  }
  const std::string written = is_kept ? flags.out : "";
  out << (is_table ? FormatLensReport(board, views, solution, written)
                   : LensReportJson(board, views, solution, written));
  for (const std::string& also : {flags.map, flags.corners}) {
    if (is_table && !also.empty()) out << "written       " << also << "\n";
  }
  if (is_kept) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat(flags.out, " was not written: ", why_not,
                                                    " --keep-poor writes it all the same"));
}

}  // namespace

void AddIntrinsicsCommand(CLI::App& app, Subcommands* all) {
  const auto [command, flags] = all->Add(
      app, "intrinsics",
      "Calibrates the lens of one camera from pictures or events of a flat board", &CalibrateLens);
  AddFrameInput(command, &flags.input);
  command
      .add_option("--board", flags.board,
                  "board:checker,9x6,0.03 (inner corners, not squares; metres), "
                  "board:circles,4x11,0.02 (asymmetric), board:circles-symmetric,9x6,0.02, "
                  "board:charuco,8x6,0.03,0.022,5x5_100, board:aprilgrid,6x6,0.088,0.3; the last "
                  "two with ,two-sided=0.004 where both sides are printed")
      ->required();
  AddOutputOption(command, &flags.out, &flags.force,
                  "OpenCV YAML for calibration=FILE of the camera")
      ->required();
  command.add_option("--model", flags.model, "Lens model; auto: by held-out error [auto]")
      ->type_name("auto|pinhole4|pinhole5|pinhole8|fisheye")
      ->check(
          CLI::IsMember({"auto", "pinhole4", "pinhole5", "pinhole8", "fisheye"}).description(""));
  command
      .add_option("--views", flags.views,
                  "Views to take at most; 0: all [40 of a camera or video, all of images]")
      ->check(CLI::NonNegativeNumber.description(""));
  command
      .add_option("--until-px", flags.until_px,
                  "End when 95 % of the image are known within so many pixels (one sigma, by noise "
                  "alone), after 10 views and more; 0: never [0.2 of a camera, 0 of a video]")
      ->check(CLI::NonNegativeNumber.description(""));
  command.add_option("--map", flags.map,
                     "PNG with the uncertainty of the lens over the image in colours");
  command
      .add_option("--corners", flags.corners,
                  "Also write the points that were found, as mrcal reads them (vnlog)")
      ->type_name("FILE");
  command.add_flag("--keep-poor", flags.keep_poor,
                   "Also write a lens that nobody should use: corners more than 0.6 px off, or "
                   "halves of the views 20 px apart");
  AddFormatOption(command, &flags.format, "table or json [table]");
  command.footer(
      "Hold the board near, tilted to every side, all over the image; of a camera, a line after "
      "each view says where to hold it next. Examples:\n"
      "  rigcal board print board:checker,9x6,0.025 --output board.svg\n"
      "  rigcal-agent intrinsics aravis:192.168.1.5 --board board:checker,9x6,0.025 --output "
      "left.yaml\n"
      "  rigcal-agent intrinsics pictures --board board:checker,9x6,0.025 --output left.yaml\n"
      "  rigcal-agent intrinsics events.raw --board board:circles,4x11,0.02,0.012 --output "
      "event.yaml\n"
      "Exit codes: 0 ok, 1 failed (the message says what to do), 2 usage.");
}

}  // namespace rigcal::agent

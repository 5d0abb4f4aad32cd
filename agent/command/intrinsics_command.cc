// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <memory>
#include <string>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "agent/capture/event_source_spec.h"
#include "agent/capture/image_file.h"
#include "agent/command/board_pictures.h"
#include "agent/command/board_views.h"
#include "agent/command/corner_file.h"
#include "agent/command/frame_input.h"
#include "agent/command/lens_report.h"
#include "agent/command/subcommands.h"
#include "common/board/board.h"
#include "common/camera/camera_export.h"
#include "common/file/durable_file.h"
#include "common/file/may_write.h"
#include "common/lens/lens_solver.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

namespace fs = std::filesystem;

constexpr int kViewsOfStream = 40;

struct IntrinsicsFlags {
  FrameInput input;
  std::string board;
  std::string out;
  bool force = false;
  std::string corners;  // file for the points that were found; empty: none
  std::string model = "auto";
  int views = -1;  // not given
  std::string format = "table";
};

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

absl::StatusOr<std::unique_ptr<BoardPictures>> PicturesOf(const Board& board,
                                                          const FrameInput& input) {
  RIGCAL_ASSIGN_OR_RETURN(const std::unique_ptr<SourceSpec> spec, ResolveInput(WithoutLens(input)));
  if (const auto* const frames = dynamic_cast<const FrameSourceSpec*>(spec.get())) {
    RIGCAL_ASSIGN_OR_RETURN(auto source, frames->Make());
    return PicturesOfFrames(board, std::move(source));
  }
  if (const auto* const events = dynamic_cast<const EventSourceSpec*>(spec.get())) {
    RIGCAL_ASSIGN_OR_RETURN(auto source, events->Make());
    return PicturesOfEvents(board, std::move(source));
  }
  return absl::InvalidArgumentError(
      absl::StrCat("camera ", spec->camera(),
                   " yields neither frames nor events; a simulated camera does with ;pixels=1"));
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
  RIGCAL_RETURN_IF_ERROR(CheckOutputFile(flags.out, flags.force));
  if (!flags.corners.empty()) {
    RIGCAL_RETURN_IF_ERROR(CheckOutputFile(flags.corners, flags.force));
  }
  RIGCAL_ASSIGN_OR_RETURN(const std::unique_ptr<BoardPictures> pictures,
                          PicturesOf(board, flags.input));
  const auto tell = [&](const BoardViews& so_far) {
    // Who waves a board wants to know when a view was taken.
    if (!is_table || is_pictures) return;
    out << absl::StrCat("view ", so_far.views.size(), " of ", collecting.views, "\n") << std::flush;
  };
  RIGCAL_ASSIGN_OR_RETURN(const BoardViews views,
                          CollectBoardViews(board, collecting, pictures.get(), tell));
  if (!flags.corners.empty()) {
    RIGCAL_RETURN_IF_ERROR(WriteOutputFile(flags.corners, CornersText(board, views)));
  }
  RIGCAL_ASSIGN_OR_RETURN(const LensSolution solution,
                          SolveLens(views.views, views.image_size_px, options));
  RIGCAL_RETURN_IF_ERROR(WriteCameraExport(flags.out, {.camera = views.camera,
                                                       .image_size_px = views.image_size_px,
                                                       .intrinsics = solution.intrinsics,
                                                       .cam_from_rig = std::nullopt}));
  out << (is_table ? FormatLensReport(board, views, solution, flags.out)
                   : LensReportJson(board, views, solution, flags.out));
  return absl::OkStatus();
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
                  "board:charuco,8x6,0.03,0.022,5x5_100, board:aprilgrid,6x6,0.088,0.3")
      ->required();
  AddOutputOption(command, &flags.out, &flags.force,
                  "OpenCV YAML for calibration=FILE of the camera")
      ->required();
  command.add_option("--model", flags.model, "Lens model; auto: by held-out error [auto]")
      ->type_name("auto|pinhole4|pinhole5|pinhole8|fisheye")
      ->check(
          CLI::IsMember({"auto", "pinhole4", "pinhole5", "pinhole8", "fisheye"}).description(""));
  command.add_option("--views", flags.views,
                     "Views to use at most; 0: all [40 of a camera or video, all of images]");
  command
      .add_option("--corners", flags.corners,
                  "Also write the points that were found, as mrcal reads them (vnlog)")
      ->type_name("FILE");
  AddFormatOption(command, &flags.format, "table or json [table]");
  command.footer(
      "Hold the board near, tilted to every side, all over the image. Examples:\n"
      "  rigcal board print board:checker,9x6,0.025 --output board.svg\n"
      "  rigcal-agent intrinsics aravis:192.168.1.5 --board board:checker,9x6,0.025 --output "
      "left.yaml\n"
      "  rigcal-agent intrinsics pictures --board board:checker,9x6,0.025 --output left.yaml\n"
      "  rigcal-agent intrinsics events.raw --board board:circles,4x11,0.02,0.012 --output "
      "event.yaml\n"
      "Exit codes: 0 ok, 1 failed (the message says what to do), 2 usage.");
}

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
#include "client/commands/lens_command.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "client/commands/calibrate_command.h"
#include "client/commands/command_parser.h"
#include "client/net/polling.h"
#include "client/net/server_connection.h"
#include "common/file/durable_file.h"
#include "common/file/may_write.h"
#include "common/import/intrinsics_file.h"
#include "common/lens/lens_difference.h"
#include "common/status/status_macros.h"
#include "rigcal/v1/lens_service.grpc.pb.h"

namespace rigcal::client {
namespace {

// Of the map that is printed.
constexpr int kShownColumns = 6, kShownRows = 4;

absl::StatusOr<LensDifference> Compare(const LensDiffOptions& options, ImageSize* size) {
  RIGCAL_ASSIGN_OR_RETURN(const IntrinsicsFile a, ReadIntrinsicsFile(options.a, options.camera));
  RIGCAL_ASSIGN_OR_RETURN(const IntrinsicsFile b, ReadIntrinsicsFile(options.b, options.camera));
  if (!(a.image_size_px == b.image_size_px)) {
    return absl::InvalidArgumentError(absl::StrCat(
        options.a, " is of an image of ", a.image_size_px.width, " x ", a.image_size_px.height,
        " pixels, ", options.b, " of ", b.image_size_px.width, " x ", b.image_size_px.height,
        ": two lenses are compared in images of one size, region and binning"));
  }
  *size = a.image_size_px;
  return CompareLenses(a.intrinsics, b.intrinsics, a.image_size_px);
}

// The largest difference of each part of the image, from the upper left.
std::string MapText(const LensDifference& difference) {
  std::string text;
  for (int row = 0; row < kShownRows; ++row) {
    text += "   ";
    for (int column = 0; column < kShownColumns; ++column) {
      double most = -1;
      for (int y = row * LensDifference::kRows / kShownRows;
           y < (row + 1) * LensDifference::kRows / kShownRows; ++y) {
        for (int x = column * LensDifference::kColumns / kShownColumns;
             x < (column + 1) * LensDifference::kColumns / kShownColumns; ++x) {
          const double here =
              difference.map_px[static_cast<size_t>(y * LensDifference::kColumns + x)];
          if (std::isfinite(here)) most = std::max(most, here);
        }
      }
      text += most < 0 ? "       -" : absl::StrFormat("%8.3f", most);
    }
    text += "\n";
  }
  return text;
}

nlohmann::ordered_json MapJson(const LensDifference& difference) {
  auto rows = nlohmann::ordered_json::array();
  for (int y = 0; y < LensDifference::kRows; ++y) {
    auto row = nlohmann::ordered_json::array();
    for (int x = 0; x < LensDifference::kColumns; ++x) {
      const double here = difference.map_px[static_cast<size_t>(y * LensDifference::kColumns + x)];
      row.push_back(std::isfinite(here) ? nlohmann::ordered_json(here) : nullptr);
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

absl::StatusOr<v1::Lens> AskForLens(ServerConnection& server, const std::string& session,
                                    const std::string& camera) {
  v1::GetLensRequest request;
  request.set_session_id(session);
  request.set_camera(camera);
  auto answer = server.Call(&v1::LensService::Stub::GetLens, request);
  if (!answer.ok()) return answer.status();
  return std::move(*answer->mutable_lens());
}

// The lens from all observations that are stored by now. FAILED_PRECONDITION: they make none; the
// server's words say why.
absl::StatusOr<v1::Lens> AwaitLens(ServerConnection& server, const std::string& session,
                                   const std::string& camera, CommandContext& context) {
  ProgressLine progress(context.console);
  uint64_t wanted = 0;  // observations
  bool is_first = true;
  absl::StatusOr<v1::Lens> lens =
      PollUntil([&] { return AskForLens(server, session, camera); },
                [&](const v1::Lens& now) {
                  if (is_first) wanted = now.stored_count();
                  is_first = false;
                  progress.Show(absl::StrCat("the lens of ", camera, " is being made from ",
                                             now.views_size(), " views"));
                  if (now.state() == v1::Lens::STATE_SOLVED) {
                    return now.result().observation_count() >= wanted;
                  }
                  return (now.state() == v1::Lens::STATE_COLLECTING ||
                          now.state() == v1::Lens::STATE_FAILED) &&
                         now.observation_count() >= wanted;
                },
                {});
  progress.Clear();
  if (!lens.ok() || lens->state() == v1::Lens::STATE_SOLVED) return lens;
  return absl::FailedPreconditionError(
      absl::StrCat("no lens of camera ", camera, ": ", lens->problem()));
}

std::string FormatLens(const v1::Lens& lens) {
  const v1::LensResult& result = lens.result();
  const v1::Intrinsics& intrinsics = result.intrinsics();
  std::string text;
  absl::StrAppendFormat(&text, "camera        %s, %d x %d px, %s\n", lens.camera(),
                        lens.image_size_px().width(), lens.image_size_px().height(), lens.board());
  absl::StrAppendFormat(&text,
                        "pictures      %d, %d with the board (not taken: %d as another one, %d "
                        "blurred); %d views and %d corners used\n",
                        lens.observation_count(), lens.board_count(), lens.alike_count(),
                        lens.blurred_count(), result.view_count(), result.corner_count());
  absl::StrAppend(&text, "model         ", result.model(), "; held-out error of each, px:");
  for (const v1::LensCandidate& candidate : result.candidates()) {
    absl::StrAppendFormat(&text, " %s %.3f", candidate.model(), candidate.held_out_rms_px());
  }
  absl::StrAppendFormat(&text, "\nfocal length  %.2f, %.2f px; middle %.2f, %.2f px\n",
                        intrinsics.fx_px(), intrinsics.fy_px(), intrinsics.cx_px(),
                        intrinsics.cy_px());
  absl::StrAppendFormat(&text, "error         %.3f px RMS, %.3f px in views that were held out\n",
                        result.rms_px(), result.held_out_rms_px());
  if (result.has_halves_p95_px()) {
    absl::StrAppendFormat(&text,
                          "two halves    of the views differ by %.3f px (median), %.3f px (95 %% "
                          "of the image)\n",
                          result.halves_median_px(), result.halves_p95_px());
  }
  if (lens.has_uncertainty()) {
    absl::StrAppendFormat(&text, "uncertainty   %.3f px (median), %.3f px (95 %% of the image)\n",
                          lens.uncertainty().median_px(), lens.uncertainty().p95_px());
  }
  absl::StrAppendFormat(&text, "coverage      corners in %.0f %% of the image\n",
                        100 * lens.covered_share());
  for (const std::string& advice : result.advice()) {
    absl::StrAppend(&text, "better        ", advice, "\n");
  }
  if (lens.has_next_pose()) {
    absl::StrAppend(&text, "next view     ", lens.next_pose().words(), "\n");
  }
  return text;
}

// The cameras of a session that have no lens of their own.
absl::StatusOr<std::vector<std::string>> CamerasWithoutLens(ServerConnection& server,
                                                            const std::string& id) {
  const auto session = SessionOf(server.CallWithId(&v1::SessionService::Stub::GetSession, id));
  if (!session.ok()) return session.status();
  std::vector<std::string> cameras;
  for (const v1::SessionCamera& camera : session->cameras()) {
    if (!camera.description().has_intrinsics()) cameras.push_back(camera.description().camera());
  }
  return cameras;
}

}  // namespace

ExitCode GetLens(const LensGetOptions& options, CommandContext& context) {
  if (!options.output.empty()) {
    const absl::Status may_write = CheckOutputFile(options.output, options.force);
    if (!may_write.ok()) return context.Fail(may_write);
  }
  ServerConnection server(context.server);
  const absl::StatusOr<v1::Lens> lens = AwaitLens(server, options.session, options.camera, context);
  if (!lens.ok()) return context.Fail(lens.status());
  if (!options.output.empty()) {
    const absl::Status written = WriteOutputFile(options.output, lens->result().opencv_yaml());
    if (!written.ok()) return context.Fail(written);
  }
  const ExitCode shown = context.Show(lens, FormatLens);
  if (!options.output.empty() && context.console.format == OutputFormat::kTable) {
    context.console.Message(absl::StrCat("written: ", options.output,
                                         ", for calibration=", options.output, " of a source"));
  }
  return shown;
}

ExitCode UseLenses(const LensUseOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  const auto cameras = CamerasWithoutLens(server, options.session);
  if (!cameras.ok()) return context.Fail(cameras.status());
  v1::CreateCalibrationRequest request;
  request.add_session_ids(options.session);
  for (const std::string& camera : *cameras) {
    const absl::StatusOr<v1::Lens> lens = AwaitLens(server, options.session, camera, context);
    if (!lens.ok()) return context.Fail(lens.status());
    context.console.Message(absl::StrFormat("camera %s: %s, %.3f px in views that were held out",
                                            camera, lens->result().model(),
                                            lens->result().held_out_rms_px()));
    v1::CameraIntrinsics* const given = request.mutable_options()->add_given_intrinsics();
    given->set_camera(camera);
    *given->mutable_image_size_px() = lens->image_size_px();
    *given->mutable_intrinsics() = lens->result().intrinsics();
  }
  request.set_reason("with the lenses found in the session");
  const absl::StatusOr<v1::Calibration> calibration = CalibrateAndWait(server, request, context);
  if (!calibration.ok()) return context.Fail(calibration.status());
  const ExitCode shown = ShowCalibration(*calibration, context);
  if (calibration->state() != v1::Calibration::STATE_SUCCEEDED || !options.activate) return shown;
  return ActivateIfGood(server, *calibration, request.reason(), context);
}

ExitCode CompareLensFiles(const LensDiffOptions& options, CommandContext& context) {
  ImageSize size;
  const absl::StatusOr<LensDifference> difference = Compare(options, &size);
  if (!difference.ok()) return context.Fail(difference.status());
  if (context.console.format == OutputFormat::kJson) {
    const nlohmann::ordered_json json = {{"image_px", {size.width, size.height}},
                                         {"median_px", difference->median_px},
                                         {"p95_px", difference->p95_px},
                                         {"most_px", difference->most_px},
                                         {"unknown_share", difference->unknown_share},
                                         {"turned_deg", difference->turned_deg},
                                         {"map_px", MapJson(*difference)}};
    context.console.out << JsonText(json) << "\n" << std::flush;
    return ExitCode::kOk;
  }
  std::string text = absl::StrFormat(
      "%.3f px apart (median), %.3f px in 95 %% of the image, %.3f px at most\n"
      "after a turn of %.4f degrees was taken out, which a calibration of the rig finds anyway\n"
      "largest difference in each part of the image, px:\n%s",
      difference->median_px, difference->p95_px, difference->most_px, difference->turned_deg,
      MapText(*difference));
  if (difference->unknown_share > 0) {
    absl::StrAppendFormat(&text, "one of the two has no ray in %.1f %% of the image\n",
                          100 * difference->unknown_share);
  }
  context.console.Print(text);
  return ExitCode::kOk;
}

void AddLensCommands(CommandParser& parser) {
  CLI::App* const group = parser.AddGroup("lens", "Lenses of cameras (get, use, diff)");
  auto [get, wanted] = parser.AddCommand(
      group, "get", "The lens of a camera from the printed board that a session has seen", GetLens);
  AddArgument(get, "SESSION", "Id of a session with --target board:...", &wanted->session);
  AddArgument(get, "CAMERA", "Camera of it, with or without a lens", &wanted->camera);
  AddOption(get, "--output", "FILE", &wanted->output,
            "Write the lens as this OpenCV YAML, for calibration=FILE of the camera");
  AddForceOption(get, &wanted->force);
  auto [use, used] = parser.AddCommand(
      group, "use",
      "Calibrate a session of a printed board with the lenses found in it, of its cameras without "
      "one, and wait for the result",
      UseLenses);
  AddArgument(use, "SESSION", "Id of a finished session with --target board:...", &used->session);
  use->add_flag("--activate", used->activate,
                "Make the result the active calibration of the rig if it is good");
  auto [app, options] = parser.AddCommand(
      group, "diff", "Say how far two lenses of one camera are apart, in pixels", CompareLensFiles,
      /*asks_server=*/false);
  AddArgument(app, "A", "A file with a lens: OpenCV, ROS, kalibr, mrcal, ...", &options->a);
  AddArgument(app, "B", "Another one of the same camera", &options->b);
  AddOption(app, "--camera", "CAMERA", &options->camera, "Which one, of files with several");
}

}  // namespace rigcal::client

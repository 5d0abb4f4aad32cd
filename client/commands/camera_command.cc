// SPDX-License-Identifier: Apache-2.0
#include "client/commands/camera_command.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "client/net/polling.h"
#include "client/net/server_connection.h"
#include "client/output/quantities.h"
#include "common/status/status_macros.h"

namespace rigcal::client {
namespace {

using CameraStub = v1::CameraService::Stub;

template <typename Request>
Request RequestFor(const CameraOptions& options) {
  Request request;
  request.set_camera(options.camera);
  request.set_rig(options.rig);
  return request;
}

// The other calls answer with the same fields.
template <typename Response>
absl::StatusOr<v1::GetDetectorResponse> DetectorOf(absl::StatusOr<Response> response) {
  if (!response.ok()) return response.status();
  v1::GetDetectorResponse detector;
  detector.set_agent_id(response->agent_id());
  detector.set_rig(response->rig());
  *detector.mutable_detector() = response->detector();
  return detector;
}

absl::StatusOr<v1::GetDetectorResponse> GetDetector(ServerConnection& server,
                                                    const CameraOptions& options) {
  return server.Call(&CameraStub::GetDetector, RequestFor<v1::GetDetectorRequest>(options));
}

std::string KindText(const v1::DetectorLearning& learning) {
  return learning.kind() == v1::DetectorLearning::KIND_MASK ? "mask" : "colour";
}

std::string ProgressText(const v1::DetectorLearning& learning) {
  return absl::StrCat("learning a ", KindText(learning), ": ", learning.frame_count(), " of ",
                      learning.wanted_frame_count(), " frames, ", learning.wand_count(),
                      " with the wand");
}

std::string FormatDetector(const std::string& camera, const v1::GetDetectorResponse& answer) {
  const v1::Detector& detector = answer.detector();
  const v1::ColourRange& colour = detector.colour();
  std::string text = absl::StrFormat(
      "camera %s/%s at agent %s\n"
      "colour: hue %.4g to %.4g deg, saturation from %.3g, value from %d, washed out from %d (%s)\n"
      "ignored: %d pixels (%.3g %%)%s\n",
      answer.rig(), camera, answer.agent_id(), colour.hue_min_deg(), colour.hue_max_deg(),
      colour.saturation_min(), colour.value_min(), colour.washed_out_min(),
      detector.colour_learnt() ? "tuned or set" : "of the agent's configuration",
      detector.ignored_pixel_count(), 100 * detector.ignored_share(),
      detector.mask_learnt() ? ", with a learnt mask" : "");
  if (!detector.has_learning()) return text;
  const v1::DetectorLearning& learning = detector.learning();
  if (learning.state() == v1::DetectorLearning::STATE_RUNNING) {
    return absl::StrCat(text, ProgressText(learning), "\n");
  }
  return absl::StrCat(text, "last learnt: ", KindText(learning), ", ",
                      learning.state() == v1::DetectorLearning::STATE_FAILED ? "failed: " : "",
                      learning.message(), "\n");
}

ExitCode Show(const CameraOptions& options, CommandContext& context,
              const absl::StatusOr<v1::GetDetectorResponse>& answer) {
  return context.Show(answer, [&](const v1::GetDetectorResponse& detector) {
    return Printable(FormatDetector(options.camera, detector));
  });
}

// Follows a learning that has begun. The agent ends it by itself, whoever looks.
ExitCode AwaitLearning(ServerConnection& server, const CameraOptions& options,
                       CommandContext& context,
                       const absl::StatusOr<v1::GetDetectorResponse>& begun) {
  if (!begun.ok()) return context.Fail(begun.status());
  ProgressLine progress(context.console);
  const auto ended = PollUntil([&] { return GetDetector(server, options); },
                               [&](const v1::GetDetectorResponse& now) {
                                 const v1::DetectorLearning& learning = now.detector().learning();
                                 progress.Show(ProgressText(learning));
                                 return learning.state() != v1::DetectorLearning::STATE_RUNNING;
                               },
                               PollOptions());
  progress.Clear();
  if (!ended.ok()) return context.Fail(ended.status());
  const v1::DetectorLearning& learning = ended->detector().learning();
  if (learning.state() != v1::DetectorLearning::STATE_SUCCEEDED) {
    return context.Fail(absl::FailedPreconditionError(
        absl::StrCat("camera ", options.camera, ": ", Printable(learning.message()))));
  }
  return Show(options, context, ended);
}

}  // namespace

ExitCode ShowDetector(const CameraOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  return Show(options, context, GetDetector(server, options));
}

ExitCode LearnCameraMask(const CameraMaskOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  if (options.clear) {
    return Show(
        options, context,
        DetectorOf(server.Call(&CameraStub::ClearMask, RequestFor<v1::ClearMaskRequest>(options))));
  }
  auto request = RequestFor<v1::LearnMaskRequest>(options);
  request.set_frame_count(options.frame_count);
  return AwaitLearning(server, options, context,
                       DetectorOf(server.Call(&CameraStub::LearnMask, request)));
}

ExitCode TuneCamera(const CameraTuneOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  auto request = RequestFor<v1::TuneDetectorRequest>(options);
  request.set_frame_count(options.frame_count);
  return AwaitLearning(server, options, context,
                       DetectorOf(server.Call(&CameraStub::TuneDetector, request)));
}

ExitCode SetCameraColour(const CameraColourOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  auto request = RequestFor<v1::SetDetectorColourRequest>(options);
  if (!options.reset) {
    const absl::StatusOr<v1::GetDetectorResponse> now = GetDetector(server, options);
    if (!now.ok()) return context.Fail(now.status());
    v1::ColourRange& colour = *request.mutable_colour();
    colour = now->detector().colour();
    if (options.hue_min_deg) colour.set_hue_min_deg(*options.hue_min_deg);
    if (options.hue_max_deg) colour.set_hue_max_deg(*options.hue_max_deg);
    if (options.saturation_min) colour.set_saturation_min(*options.saturation_min);
    if (options.value_min) colour.set_value_min(*options.value_min);
    if (options.washed_out_min) colour.set_washed_out_min(*options.washed_out_min);
  }
  return Show(options, context, DetectorOf(server.Call(&CameraStub::SetDetectorColour, request)));
}

}  // namespace rigcal::client

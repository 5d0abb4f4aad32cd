// SPDX-License-Identifier: Apache-2.0
#include "client/commands/agent_preview_command.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/strip.h"
#include "client/net/server_connection.h"
#include "client/output/output.h"

namespace rigcal::client {
namespace {

// A picture that is to be seen is there whole, or the one before still is.
absl::Status WriteWhole(const std::string& path, const std::string& bytes) {
  const std::string temporary = path + ".part";
  std::ofstream file(temporary, std::ios::binary | std::ios::trunc);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (file && std::rename(temporary.c_str(), path.c_str()) == 0) return absl::OkStatus();
  const std::string why = std::strerror(errno);
  std::remove(temporary.c_str());
  return absl::FailedPreconditionError(absl::StrCat("cannot write the picture to ", path, ": ", why,
                                                    "; name another file with --out"));
}

std::string OutcomeText(v1::DetectionOutcome outcome) {
  const std::string name = v1::DetectionOutcome_Name(outcome);
  if (name.empty()) return absl::StrCat("outcome ", static_cast<int>(outcome));
  return absl::StrReplaceAll(absl::AsciiStrToLower(absl::StripPrefix(name, "DETECTION_OUTCOME_")),
                             {{"_", " "}});
}

std::string Describe(const v1::GetPreviewResponse& preview, const std::string& file) {
  const v1::PreviewInfo& info = preview.info();
  std::string text = absl::StrCat(
      file, ": camera ", preview.rig(), "/", info.camera(), ", ", info.jpeg_size_px().width(), "x",
      info.jpeg_size_px().height(), " pixels of ", info.image_size_px().width(), "x",
      info.image_size_px().height(), ", ", (preview.jpeg().size() + 1023) / 1024, " KiB\n",
      "detector: ", OutcomeText(info.outcome()));
  if (info.outcome() == v1::DETECTION_OUTCOME_WAND) {
    absl::StrAppendFormat(&text, ", confidence %.2f, %d markers", info.confidence(),
                          info.visible_marker_count());
  }
  return absl::StrCat(text, ", ", info.blob_count(), info.blob_count() == 1 ? " blob" : " blobs",
                      info.tracked() ? ", tracked" : "", "\n");
}

}  // namespace

ExitCode PreviewCamera(const AgentPreviewOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  v1::GetPreviewRequest request;
  request.set_camera(options.camera);
  request.set_rig(options.rig);
  const auto preview = server.Call(server.cameras(), &v1::CameraService::Stub::GetPreview, request);
  if (!preview.ok()) return context.Fail(preview.status());
  // The server has checked the name: it is no path.
  const std::string file = options.file.empty() ? preview->info().camera() + ".jpg" : options.file;
  if (const absl::Status status = WriteWhole(file, preview->jpeg()); !status.ok()) {
    return context.Fail(status);
  }
  if (context.console.format == OutputFormat::kJson) {
    v1::GetPreviewResponse meta = *preview;
    meta.clear_jpeg();
    PrintJson(context.console, meta);
  } else {
    context.console.out << Printable(Describe(*preview, file));
  }
  return ExitCode::kOk;
}

}  // namespace rigcal::client

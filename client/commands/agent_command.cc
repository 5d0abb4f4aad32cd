// SPDX-License-Identifier: Apache-2.0
#include "client/commands/agent_command.h"

#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "client/output/quantities.h"
#include "client/output/text_table.h"
#include "common/file/durable_file.h"
#include "common/file/may_write.h"

namespace rigcal::client {
namespace {

std::string SizeText(const v1::ImageSize& size_px) {
  return absl::StrCat(size_px.width(), "x", size_px.height());
}

// "BayerRG8, 5 ms, 6 dB, 50 Hz, Line0, PTP"; the model is left to JSON.
std::string SettingsText(const v1::CameraDescription& camera) {
  const v1::CameraSettings& settings = camera.settings();
  std::vector<std::string> parts;
  if (!settings.pixel_format().empty()) parts.push_back(settings.pixel_format());
  if (settings.exposure_s() > 0) {
    parts.push_back(absl::StrFormat("%.4g ms", settings.exposure_s() * 1e3));
  }
  if (settings.gain_db() != 0) parts.push_back(absl::StrFormat("%.4g dB", settings.gain_db()));
  if (settings.frame_rate_hz() > 0) {
    parts.push_back(absl::StrFormat("%.4g Hz", settings.frame_rate_hz()));
  }
  if (!settings.trigger().empty()) parts.push_back(settings.trigger());
  if (settings.ptp()) parts.emplace_back("PTP");
  return parts.empty() ? "-" : absl::StrJoin(parts, ", ");
}

// "1200 rows, 150 KiB, 12 dropped"; "-" where nothing was reported.
std::string SpoolText(const v1::Agent& agent) {
  if (!agent.has_spool()) return "-";
  const v1::SpoolStatus& spool = agent.spool();
  uint64_t dropped = 0;
  for (const v1::RefusalCount& refusal : spool.dropped()) dropped += refusal.count();
  std::string text =
      absl::StrCat(FormatCount(spool.row_count(), "row"), ", ", FormatBytes(spool.bytes()));
  if (dropped > 0) absl::StrAppend(&text, ", ", dropped, " dropped");
  if (!spool.problem().empty()) text += ", has a problem";
  return text;
}

// What is wrong with spools, and what they dropped, below the table.
std::string FormatSpoolFaults(const v1::ListAgentsResponse& response) {
  std::string text;
  for (const v1::Agent& agent : response.agents()) {
    const v1::SpoolStatus& spool = agent.spool();
    if (!spool.problem().empty()) {
      absl::StrAppend(&text, "agent ", agent.agent_id(), ": ", spool.problem(), "\n");
    }
    for (const v1::RefusalCount& refusal : spool.dropped()) {
      absl::StrAppend(&text, "agent ", agent.agent_id(), ": ",
                      FormatCount(refusal.count(), "observation"),
                      " dropped: ", EnumWord(refusal.reason()), "\n");
    }
  }
  return text.empty() ? "" : absl::StrCat("\n", text);
}

std::string FormatAgents(const v1::ListAgentsResponse& response) {
  if (response.agents().empty()) return "no agents\n";
  TextTable table;
  table.Words({"agent", "host", "rig", "state", "since", "version", "spool", "camera"})
      .Numbers({"image (px)"})
      .Words({"intrinsics", "settings", "source"});
  for (const v1::Agent& agent : response.agents()) {
    std::vector<TextTable::Cell> cells = {
        agent.agent_id(),
        agent.host(),
        agent.rig(),
        agent.connected() ? "connected" : "gone",
        agent.connected() ? FormatTime(agent.has_connect_time(), agent.connect_time())
                          : FormatTime(agent.has_disconnect_time(), agent.disconnect_time()),
        agent.software_version(),
        SpoolText(agent)};
    const size_t agent_cells = cells.size();
    if (agent.cameras().empty()) table.AddRow(cells);
    for (const v1::CameraDescription& camera : agent.cameras()) {
      cells.resize(agent_cells, "");
      cells.insert(
          cells.end(),
          {camera.camera(), camera.has_image_size_px() ? SizeText(camera.image_size_px()) : "-",
           camera.has_intrinsics() ? "yes" : "no", SettingsText(camera), camera.source()});
      table.AddRow(cells);
      // What is the same for all cameras of an agent stands in its first line only.
      cells.assign(agent_cells, "");
    }
  }
  return table.Format() + FormatSpoolFaults(response);
}

std::string DescribePreview(const v1::GetPreviewResponse& preview, const std::string& file) {
  const v1::PreviewInfo& info = preview.info();
  std::string text = absl::StrCat(
      file, ": camera ", preview.rig(), "/", info.camera(), ", ", SizeText(info.jpeg_size_px()),
      " pixels of ", SizeText(info.image_size_px()), ", ", (preview.jpeg().size() + 1023) / 1024,
      " KiB\ndetector: ", absl::StrReplaceAll(EnumWord(info.outcome()), {{"_", " "}}));
  if (info.outcome() == v1::DETECTION_OUTCOME_WAND) {
    absl::StrAppendFormat(&text, ", confidence %.2f, %d markers", info.confidence(),
                          info.visible_marker_count());
  }
  return absl::StrCat(text, ", ", FormatCount(info.blob_count(), "blob"),
                      info.tracked() ? ", tracked" : "", "\n");
}

}  // namespace

ExitCode ListAgents(const ListOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  return context.Show(ReadAllPages(server, &v1::AgentService::Stub::ListAgents, options),
                      FormatAgents);
}

ExitCode MoveCamera(const CameraMoveOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  v1::MoveCameraRequest request;
  request.set_rig(options.rig);
  request.set_camera(options.camera);
  request.set_agent_id(options.agent_id);
  return context.Show(server.Call(&v1::CameraService::Stub::MoveCamera, request),
                      [](const v1::MoveCameraResponse& moved) {
                        const std::string& before = moved.previous_agent_id();
                        return absl::StrCat("camera ", moved.rig(), "/", moved.camera(),
                                            " belongs to agent ", moved.agent_id(),
                                            before.empty() ? "" : ", before to " + before, "\n");
                      });
}

ExitCode PreviewCamera(const AgentPreviewOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  v1::GetPreviewRequest request;
  request.set_camera(options.camera);
  request.set_rig(options.rig);
  auto preview = server.Call(&v1::CameraService::Stub::GetPreview, request);
  if (!preview.ok()) return context.Fail(preview.status());
  // The server has checked the name: it is no path.
  const std::string file = options.file.empty() ? preview->info().camera() + ".jpg" : options.file;
  if (const absl::Status free = CheckOutputFile(file, options.force); !free.ok()) {
    return context.Fail(free);
  }
  if (const absl::Status status = WriteOutputFile(file, preview->jpeg()); !status.ok()) {
    return context.Fail(absl::FailedPreconditionError(
        absl::StrCat(std::string(status.message()), "; name another file with --output")));
  }
  const std::string text = Printable(DescribePreview(*preview, file));
  preview->clear_jpeg();
  return context.Show(preview, [&](const auto&) { return text; });
}

}  // namespace rigcal::client

// SPDX-License-Identifier: Apache-2.0
#include "client/commands/agent_command.h"

#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "client/net/paging.h"
#include "client/net/server_connection.h"
#include "client/output/output.h"
#include "client/output/quantities.h"
#include "client/output/text_table.h"

namespace rigcal::client {
namespace {

std::string ImageSizeText(const v1::CameraDescription& camera) {
  if (!camera.has_image_size_px()) return "-";
  return absl::StrCat(camera.image_size_px().width(), "x", camera.image_size_px().height());
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

std::string FormatAgents(const v1::ListAgentsResponse& response) {
  if (response.agents().empty()) return "no agents\n";
  TextTable table({{"agent"},
                   {"host"},
                   {"rig"},
                   {"state"},
                   {"since"},
                   {"version"},
                   {"camera"},
                   {"image (px)", TextTable::Align::kRight},
                   {"intrinsics"},
                   {"settings"},
                   {"source"}});
  for (const v1::Agent& agent : response.agents()) {
    std::vector<std::string> cells = {
        agent.agent_id(),
        agent.host(),
        agent.rig(),
        agent.connected() ? "connected" : "gone",
        agent.connected() ? FormatTime(agent.has_connect_time(), agent.connect_time())
                          : FormatTime(agent.has_disconnect_time(), agent.disconnect_time()),
        agent.software_version()};
    const size_t agent_cells = cells.size();
    if (agent.cameras().empty()) table.AddRow(cells);
    for (const v1::CameraDescription& camera : agent.cameras()) {
      cells.resize(agent_cells);
      cells.insert(cells.end(),
                   {camera.camera(), ImageSizeText(camera), camera.has_intrinsics() ? "yes" : "no",
                    SettingsText(camera), camera.source()});
      table.AddRow(cells);
      // What is the same for all cameras of an agent stands in its first line only.
      cells.assign(agent_cells, "");
    }
  }
  return table.Format();
}

}  // namespace

absl::StatusOr<v1::ListAgentsResponse> ReadAllAgents(ServerConnection& server,
                                                     const ListOptions& options) {
  return ReadAllPages<v1::ListAgentsRequest, v1::ListAgentsResponse>(
      [&](const v1::ListAgentsRequest& request) {
        return server.Call(server.agents(), &v1::AgentService::Stub::ListAgents,
                           WithListOptions(request, options));
      },
      [](v1::ListAgentsResponse& all, v1::ListAgentsResponse& page) {
        for (v1::Agent& agent : *page.mutable_agents()) all.add_agents()->Swap(&agent);
      });
}

ExitCode ListAgents(const ListOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  const auto agents = ReadAllAgents(server, options);
  if (!agents.ok()) return context.Fail(agents.status());
  if (context.console.format == OutputFormat::kJson) {
    PrintJson(context.console, *agents);
  } else {
    context.console.out << FormatAgents(*agents);
  }
  return ExitCode::kOk;
}

}  // namespace rigcal::client

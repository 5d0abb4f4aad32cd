// SPDX-License-Identifier: Apache-2.0
#include "client/commands/camera_choice_command.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "client/net/paging.h"
#include "client/net/polling.h"
#include "client/net/server_connection.h"
#include "client/output/quantities.h"
#include "client/output/text_table.h"
#include "client/tables/notable_cameras.h"
#include "common/file/durable_file.h"
#include "common/import/intrinsics_file.h"
#include "common/status/status_macros.h"

namespace rigcal::client {
namespace {

using OfferedUse = v1::OfferedCamera::Use;
using CameraStubOf = v1::CameraService::Stub;

// An agent connects again with its changed cameras in a fraction of a second.
constexpr std::chrono::seconds kLongestReturn{10};

std::string UseText(const v1::OfferedCamera& camera) {
  std::string text = absl::StrReplaceAll(EnumWord(camera.use()), {{"_", " "}});
  if (camera.configured()) text += " (configured)";
  return text;
}

std::string OrDash(const std::string& text) { return text.empty() ? "-" : text; }

// The rows of the table of cameras; of many those that need something.
class OfferRows {
 public:
  explicit OfferRows(bool all) : all_(all) {}

  void Add(bool needs_something, std::vector<TextTable::Cell> cells) {
    rows_.emplace_back(needs_something, std::move(cells));
  }
  bool empty() const { return rows_.empty(); }
  // The rows, with a line above them where some are left out.
  std::string Format() const {
    const auto needing = static_cast<size_t>(std::ranges::count_if(rows_, &Row::first));
    const bool summarised = !all_ && rows_.size() > kFewCameras;
    TextTable table;
    table.Words({"agent", "device", "model", "address", "state", "camera", "lens"});
    for (const auto& [needs_something, cells] : rows_) {
      if (!summarised || needs_something) table.AddRow(cells);
    }
    if (!summarised) return table.Format();
    return absl::StrCat(rows_.size() - needing, " of ", rows_.size(),
                        " cameras take part with a lens; ",
                        needing == 0 ? "no other needs something" : "listed are the others",
                        ", with --all every one\n", table.empty() ? "" : table.Format());
  }

 private:
  using Row = std::pair<bool, std::vector<TextTable::Cell>>;
  const bool all_;
  std::vector<Row> rows_;
};

// Cameras that an agent announces without offering them: recordings, others' kinds of source.
void AddAnnounced(const v1::Agent& agent, OfferRows* rows) {
  std::set<std::string> offered;
  for (const v1::OfferedCamera& camera : agent.offered()) offered.insert(camera.camera());
  for (const v1::CameraDescription& camera : agent.cameras()) {
    if (offered.contains(camera.camera())) continue;
    rows->Add(!camera.has_intrinsics(),
              {agent.agent_id(), "-", OrDash(camera.source()), "-", "takes part (configured)",
               camera.camera(), camera.has_intrinsics() ? "yes" : "no"});
  }
}

bool HasLens(const v1::Agent& agent, const std::string& camera) {
  return std::ranges::any_of(agent.cameras(), [&](const v1::CameraDescription& one) {
    return one.camera() == camera && one.has_intrinsics();
  });
}

std::string FormatOffers(const v1::ListAgentsResponse& response, bool all) {
  OfferRows rows(all);
  std::string notes;
  std::string example;
  for (const v1::Agent& agent : response.agents()) {
    if (!agent.connected()) continue;
    for (const v1::OfferedCamera& camera : agent.offered()) {
      const bool takes_part = camera.use() == v1::OfferedCamera::USE_TAKES_PART;
      const std::string model = absl::StrCat(
          camera.vendor(), camera.vendor().empty() || camera.model().empty() ? "" : " ",
          camera.model());
      const std::string lens = !takes_part ? "-" : HasLens(agent, camera.camera()) ? "yes" : "no";
      rows.Add(lens != "yes" || !camera.note().empty(),
               {agent.agent_id(), camera.device(), OrDash(model), OrDash(camera.address()),
                UseText(camera), OrDash(camera.camera()), lens});
      if (!camera.note().empty()) {
        absl::StrAppend(&notes, agent.agent_id(), "/", camera.device(), ": ", camera.note(), "\n");
      }
      if (example.empty() && camera.use() == v1::OfferedCamera::USE_FREE &&
          camera.camera().empty()) {
        example = absl::StrCat(agent.agent_id(), "/", camera.device());
      }
    }
    AddAnnounced(agent, &rows);
  }
  if (rows.empty()) {
    return "no connected agent has or sees a camera; rigcal agent list shows the agents, "
           "rigcal-agent cameras on a PC what is seen from there\n";
  }
  if (!example.empty()) {
    absl::StrAppend(&notes, "To use one: rigcal cameras use ", example,
                    " --name NAME --calibration LENS.yaml\n");
  }
  return absl::StrCat(rows.Format(), notes);
}

absl::StatusOr<v1::ListAgentsResponse> ReadAgents(ServerConnection& server,
                                                  const CameraListOptions& options) {
  ListOptions list;
  list.rig = options.rig;
  if (!options.agent_id.empty()) list.filter = absl::StrCat("agent_id=\"", options.agent_id, "\"");
  return ReadAllPages(server, &v1::AgentService::Stub::ListAgents, list);
}

// The agent once it is connected again with the camera, or without it. None: not in time.
absl::StatusOr<std::optional<v1::Agent>> AwaitAgent(ServerConnection& server,
                                                    const std::string& agent_id,
                                                    const std::string& camera, bool takes_part) {
  const auto give_up = std::chrono::steady_clock::now() + kLongestReturn;
  std::optional<v1::Agent> found;
  const auto is_there = [&](const v1::ListAgentsResponse& response) {
    for (const v1::Agent& agent : response.agents()) {
      const bool has_it = std::ranges::any_of(
          agent.cameras(),
          [&](const v1::CameraDescription& one) { return one.camera() == camera; });
      if (agent.connected() && has_it == takes_part) found = agent;
    }
    return found.has_value() || std::chrono::steady_clock::now() > give_up;
  };
  const auto answer =
      PollUntil([&] { return ReadAgents(server, {.rig = "", .agent_id = agent_id}); }, is_there,
                PollOptions());
  if (!answer.ok()) return answer.status();
  return found;
}

absl::StatusOr<std::string> ReadLens(const CameraUseOptions& options) {
  if (options.calibration_file.empty()) return std::string();
  // Whether it is a lens at all can be said here, with the name that was typed.
  RIGCAL_RETURN_IF_ERROR(ReadIntrinsicsFile(options.calibration_file, options.camera).status());
  return ReadSmallFile(options.calibration_file);
}

}  // namespace

ExitCode ListCameras(const CameraListOptions& options, CommandContext& context) {
  if (options.json) context.console.format = OutputFormat::kJson;
  ServerConnection server(context.server);
  return context.Show(ReadAgents(server, options), [&](const v1::ListAgentsResponse& agents) {
    return Printable(FormatOffers(agents, options.all));
  });
}

ExitCode UseCamera(const CameraUseOptions& options, CommandContext& context) {
  absl::StatusOr<std::string> lens = ReadLens(options);
  if (!lens.ok()) return context.Fail(lens.status());
  ServerConnection server(context.server);
  v1::UseCameraRequest request;
  const size_t slash = options.device.find('/');
  if (slash != std::string::npos) request.set_agent_id(options.device.substr(0, slash));
  request.set_device(options.device.substr(slash + 1));  // npos + 1 is 0
  request.set_camera(options.camera);
  request.set_calibration_yaml(*std::move(lens));
  const auto used = server.Call(&CameraStubOf::UseCamera, request);
  if (!used.ok()) return context.Fail(used.status());
  const auto agent = AwaitAgent(server, used->agent_id(), used->camera(), true);
  if (!agent.ok()) return context.Fail(agent.status());
  if (!*agent) {
    context.console.Message(absl::StrCat("agent ", used->agent_id(),
                                         " has not connected again yet; rigcal cameras shows when "
                                         "the camera takes part"));
  } else if (!HasLens(**agent, used->camera())) {
    context.console.Message(absl::StrCat(
        "camera ", used->camera(),
        " has no lens, which a calibration needs; with one: rigcal cameras drop ", used->camera(),
        ", then use it with --calibration LENS.yaml (docs/lenses.md)"));
  }
  return context.Show(used, [&](const v1::UseCameraResponse& response) {
    return Printable(absl::StrCat("camera ", response.rig(), "/", response.camera(), " is device ",
                                  request.device(), " of agent ", response.agent_id(), "\n"));
  });
}

ExitCode DropCamera(const CameraOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  v1::DropCameraRequest request;
  request.set_camera(options.camera);
  request.set_rig(options.rig);
  const auto dropped = server.Call(&CameraStubOf::DropCamera, request);
  if (!dropped.ok()) return context.Fail(dropped.status());
  const auto agent = AwaitAgent(server, dropped->agent_id(), dropped->camera(), false);
  if (!agent.ok()) return context.Fail(agent.status());
  return context.Show(dropped, [](const v1::DropCameraResponse& response) {
    return Printable(absl::StrCat("camera ", response.rig(), "/", response.camera(),
                                  " takes no part any more; agent ", response.agent_id(),
                                  " offers it again\n"));
  });
}

}  // namespace rigcal::client

// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <filesystem>
#include <iomanip>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "absl/strings/str_cat.h"
#include "agent/capture/genicam/aravis_discovery.h"
#include "agent/capture/genicam/reachable_cameras.h"
#include "agent/command/subcommands.h"
#include "common/config/agent_config.h"
#include "common/status/status_macros.h"
#include "common/text/printable.h"

namespace rigcal::agent {
namespace {

constexpr char kConfigOfPackage[] = "/etc/rigcal/agent.toml";

struct CamerasFlags {
  std::string config;
  std::string network_interface;
  std::string format = "table";
  bool fake = false;
};

struct ListedCamera : ReachableCamera {
  std::string camera;  // its name in the configuration; empty: it is not there
};

absl::StatusOr<std::vector<CameraConfig>> ConfiguredCameras(const CamerasFlags& flags) {
  std::string path = flags.config;
  if (path.empty() && std::filesystem::exists(kConfigOfPackage)) path = kConfigOfPackage;
  if (path.empty()) return std::vector<CameraConfig>();
  const absl::StatusOr<AgentConfig> config = ReadAgentConfig(path);
  // A fault of the file, not of the command line.
  if (!config.ok()) return absl::FailedPreconditionError(std::string(config.status().message()));
  return config->cameras;
}

// The name that a camera has in the configuration.
std::string ConfiguredName(const std::vector<CameraConfig>& cameras, const FoundCamera& found) {
  constexpr std::string_view kKind = "aravis:";
  for (const CameraConfig& camera : cameras) {
    const std::string_view source = camera.source;
    const size_t at = source.find(kKind);
    if (at == source.npos) continue;
    const std::string_view device =
        source.substr(at + kKind.size(), source.find(';', at) - at - kKind.size());
    if (!found.IsNamed(device)) continue;
    if (!camera.name.empty()) return camera.name;
    return std::string(at > 0 ? source.substr(0, at - 1) : device);
  }
  return "";
}

// "-" for what is not known.
std::string Cell(const std::string& text) { return text.empty() ? "-" : Printable(text); }

void PrintTable(const std::vector<ListedCamera>& cameras, std::ostream& out) {
  std::vector<std::vector<std::string>> rows = {
      {"serial", "vendor", "model", "address", "state", "takes part as"}};
  for (const ListedCamera& camera : cameras) {
    rows.push_back({Cell(camera.found.serial), Cell(camera.found.vendor), Cell(camera.found.model),
                    Cell(camera.found.address), std::string(NameOf(camera.state)),
                    Cell(camera.camera)});
  }
  std::vector<size_t> widths(rows.front().size());
  for (const auto& row : rows) {
    for (size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  }
  for (const auto& row : rows) {
    for (size_t i = 0; i + 1 < row.size(); ++i) {
      out << std::left << std::setw(static_cast<int>(widths[i]) + 2) << row[i];
    }
    out << row.back() << "\n";
  }
  for (const ListedCamera& camera : cameras) {
    if (camera.note.empty()) continue;
    out << Cell(camera.found.serial) << ": " << NameOf(camera.state) << ": "
        << Printable(camera.note) << "\n";
  }
}

void PrintCamerasJson(const std::vector<ListedCamera>& cameras, std::ostream& out) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const ListedCamera& camera : cameras) {
    list.push_back({{"device", camera.found.id},
                    {"serial", camera.found.serial},
                    {"vendor", camera.found.vendor},
                    {"model", camera.found.model},
                    {"address", camera.found.address},
                    {"protocol", camera.found.protocol},
                    {"source", absl::StrCat("aravis:", DeviceOf(camera.found))},
                    {"state", NameOf(camera.state)},
                    {"note", camera.note},
                    {"camera", camera.camera}});
  }
  // What a camera says of itself need not be UTF-8.
  out << list.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) << "\n";
}

absl::Status ListCameras(const CamerasFlags& flags, std::ostream& out) {
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<CameraConfig> configured, ConfiguredCameras(flags));
  if (flags.fake) FindFakeCameraToo();
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<ReachableCamera> reachable,
                          FindReachableCameras(flags.network_interface));
  std::vector<ListedCamera> cameras;
  for (const ReachableCamera& camera : reachable) {
    cameras.push_back({camera, ConfiguredName(configured, camera.found)});
  }
  if (flags.format == "json") {
    PrintCamerasJson(cameras, out);
    return absl::OkStatus();
  }
  if (cameras.empty()) {
    out << "No camera answers. Is it powered and plugged in, and this PC's address in its network? "
           "Event cameras are not listed.\n";
    return absl::OkStatus();
  }
  PrintTable(cameras, out);
  const auto unused = std::ranges::find_if(cameras, [](const auto& camera) {
    return camera.state == ReachableCamera::State::kFree && camera.camera.empty();
  });
  if (unused != cameras.end()) {
    out << "To use one: rigcal-agent --source 'NAME="
        << Printable(absl::StrCat("aravis:", DeviceOf(unused->found)))
        << ";calibration=NAME.yaml', or a [[camera]] in agent.toml.\n";
  }
  return absl::OkStatus();
}

}  // namespace

void AddCamerasCommand(CLI::App& app, Subcommands* all) {
  const auto [command, flags] =
      all->Add(app, "cameras",
               "Lists the GigE Vision and USB3 Vision cameras that this PC reaches, and who uses "
               "them",
               &ListCameras);
  command.add_option("--config", flags.config,
                     "TOML file that names cameras [/etc/rigcal/agent.toml, if it is there]");
  command.add_option("--interface", flags.network_interface,
                     "Only cameras at this network interface, such as eth1");
  command.add_flag("--fake", flags.fake, "Also Aravis' own fake camera, to try things out");
  AddFormatOption(command, &flags.format, "table or json [table]");
  command.add_flag_callback(
      "--json", [format = &flags.format] { *format = "json"; }, "The same as -o json");
  command.footer(
      "Examples:\n"
      "  rigcal-agent cameras\n"
      "  rigcal-agent cameras --interface eth1 --json\n"
      "Asks cameras who controls them, and does not take control itself.\n"
      "Exit codes: 0 ok, whether there is a camera or not, 1 failed, 2 usage.");
}

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
#include "tests/architecture/include_rules.h"

#include <algorithm>
#include <optional>
#include <regex>
#include <sstream>

namespace rigcal::testing {

const std::vector<Layer>& Layers() {
  static const auto* const kLayers = new std::vector<Layer>{
      // What all programs share.
      {"numbers and words",
       {"common/failpoint", "common/geometry", "common/service", "common/statistics",
        "common/status", "common/text", "common/time"}},
      {"files, options, boards",
       {"common/associate", "common/board", "common/file", "common/light_code", "common/log",
        "common/options"}},
      {"cameras, targets, configuration, keys",
       {"common/camera", "common/command_line", "common/config", "common/identity",
        "common/target"}},
      {"sessions and calibrations",
       {"common/calibration", "common/enrolment", "common/import", "common/lens", "common/session",
        "common/simulation/world"}},
      {"messages, points in space, rendered frames",
       {"common/discovery", "common/simulation/frames", "common/triangulate", "common/wire"}},
      {"exports, frames of reference, rendered events",
       {"common/export", "common/origin", "common/scale", "common/simulation/events"}},
      {"simulated recordings", {"common/simulation"}},

      // Each program by itself, from the bottom up.
      {"agent: blobs, events, spooled rows", {"agent/detect/blobs", "agent/event", "agent/spool"}},
      {"agent: wands, boards, files",
       {"agent/detect/board", "agent/detect/light_code", "agent/event_files", "agent/identify",
        "agent/spool/disk"}},
      {"agent: detectors",
       {"agent/detect/event", "agent/detect/event_board", "agent/detect/frame"}},
      {"agent: previews", {"agent/capture/preview"}},
      {"agent: sources", {"agent/capture"}},
      {"agent: kinds of source",
       {"agent/capture/genicam", "agent/capture/learning", "agent/capture/metavision",
        "agent/capture/recorded", "agent/capture/registry", "agent/capture/simulated",
        "agent/stamp"}},
      {"agent: offered cameras", {"agent/offer"}},
      {"agent: the connection", {"agent/uplink"}},
      {"agent: commands", {"agent/command"}},

      {"server: who asks, what is stored, rows by time, bundle adjustment",
       {"server/access", "server/associate", "server/audit", "server/identity", "server/store",
        "server/solve/bundle"}},
      {"server: ports, ingest, tables",
       {"server/api", "server/ingest", "server/listen", "server/replica", "server/solve/geometry",
        "server/solve/trajectory", "server/store/sql"}},
      {"server: pages, a start for the solve, databases",
       {"server/http", "server/solve/initialize", "server/store/postgresql",
        "server/store/sqlite"}},
      {"server: a rig, a store by its place", {"server/solve/rig", "server/store/factory"}},
      {"server: its clocks", {"server/solve/clocks"}},
      {"server: how good it is", {"server/solve/evaluate"}},
      {"server: what is wrong", {"server/solve/diagnose", "server/solve/running"}},
      {"server: the solve", {"server/solve"}},
      {"server: sessions, the solving process", {"server/session", "server/worker"}},
      {"server: jobs, live state", {"server/jobs", "server/lens", "server/live", "server/metrics"}},
      {"server: services, the program that solves",
       {"server/estimate", "server/monitor", "server/rpc", "server/worker/main.cc"}},
      {"server: care of the data, turns of several servers", {"server/care", "server/turn"}},
      {"server: standbys", {"server/standby"}},
      {"server: its parts put together", {"server/program"}},

      {"client: connection, output", {"client/net", "client/output"}},
      {"client: results", {"client/results", "client/tables"}},
      {"client: commands", {"client/commands"}},
      {"client: one PC", {"client/local"}},
      {"client: watch", {"client/watch"}},
      {"client: the program", {"client"}},
  };
  return *kLayers;
}

const std::vector<Island>& Islands() {
  static const auto* const kIslands = new std::vector<Island>{
      {{"agent/detect", "agent/identify", "agent/event"}, "finding a wand is known to no camera"},
      {{"agent/spool"}, "rows are kept whatever they come from"},
      {{"server/solve", "server/associate"}, "a solve can run elsewhere"},
      {{"server/store"}, "a store knows sessions and calibrations only"},
  };
  return *kIslands;
}

namespace {

// "server/solve/rig/x.cc" -> "server/solve/rig"; a program's main is a folder of its own:
// "agent/main.cc" -> "agent/main.cc".
std::string FolderOf(std::string_view path) {
  const size_t last = path.rfind('/');
  if (last == std::string_view::npos) return "";
  if (path.substr(last) == "/main.cc") return std::string(path);
  return std::string(path.substr(0, last));
}

// "server/solve/rig" is inside "server/solve".
bool IsInside(std::string_view folder, std::string_view outer) {
  return folder == outer ||
         (folder.size() > outer.size() && folder.substr(0, outer.size()) == outer &&
          folder[outer.size()] == '/');
}

std::string ProgramOf(std::string_view path) { return std::string(path.substr(0, path.find('/'))); }

bool IsInsideAny(std::string_view folder, const std::vector<std::string>& outers) {
  return std::any_of(outers.begin(), outers.end(),
                     [&](const std::string& outer) { return IsInside(folder, outer); });
}

std::optional<size_t> LayerNumber(const std::string& folder) {
  for (size_t i = 0; i < Layers().size(); ++i) {
    if (Layers()[i].folders.contains(folder)) return i;
  }
  return std::nullopt;
}

// Who turns messages into what the rest of the tree knows.
const std::vector<std::string>& SeesMessages() {
  static const auto* const kFolders = new std::vector<std::string>{
      "agent/uplink",   "client",     "common/export",    "common/wire",  "server/jobs",
      "server/program", "server/rpc", "server/store/sql", "server/worker"};
  return *kFolders;
}

// An outside library, told by how its headers begin, and the folders that may see it.
struct LibraryRule {
  std::string name;
  std::vector<std::string> prefixes;
  std::vector<std::string> folders;
};

const std::vector<LibraryRule>& LibraryRules() {
  static const auto* const kRules = new std::vector<LibraryRule>{
      {"gRPC",
       {"grpc", "rigcal/v1/", "rigcal/storage/"},
       {"common/export", "common/wire", "server/rpc", "agent/uplink", "client"}},
      {"protobuf",
       {"google/protobuf", "rigcal/worker/"},
       {"common/export", "common/wire", "server/rpc", "agent/uplink", "client", "server/jobs",
        "server/worker"}},
      {"TOML", {"toml++", "toml.hpp"}, {"common/config", "common/import"}},
      {"YAML", {"yaml-cpp", "opencv2/core/persistence"}, {"common/camera", "common/import"}},
      {"libxml2", {"libxml/"}, {"common/import"}},
      {"libarchive", {"archive"}, {"common/export"}},
      {"SQLite", {"SQLiteCpp", "sqlite3"}, {"server/store/sqlite"}},
      {"libpq", {"libpq", "postgres"}, {"server/store/postgresql"}},
      {"Ceres", {"ceres/", "glog/"}, {"server/solve"}},
      {"OpenCV",
       {"opencv2/"},
       {"common/board", "common/camera", "common/simulation/frames", "server/solve",
        "agent/capture", "agent/detect", "agent/identify", "agent/command"}},
      {"Aravis", {"arv", "glib"}, {"agent/capture/genicam"}},
      {"Avahi", {"avahi-"}, {"common/discovery"}},
      {"libsystemd", {"systemd/"}, {"common/log", "common/service"}},
      {"the Metavision SDK", {"metavision/"}, {"agent/capture/metavision"}},
      {"CLI11",
       {"CLI/"},
       {"client", "common/command_line", "agent/command", "agent/main.cc", "server/care",
        "server/main.cc", "server/program", "server/standby", "server/worker/main.cc"}},
      {"HDF5", {"hdf5", "H5"}, {"agent/event_files"}},
      {"Prometheus", {"prometheus/"}, {"server/metrics"}},
      {"HTTP", {"boost/beast", "boost/asio"}, {"server/http", "common/enrolment"}},
      {"OpenSSL",
       {"openssl/"},
       {"common/identity", "common/enrolment", "server/identity", "server/session",
        "server/solve"}},
  };
  return *kRules;
}

bool StartsWith(std::string_view text, std::string_view prefix) {
  return text.substr(0, prefix.size()) == prefix;
}

bool IsProjectInclude(std::string_view include) {
  for (const std::string_view program : {"common/", "agent/", "server/", "client/", "tests/"}) {
    if (StartsWith(include, program)) return true;
  }
  return false;
}

std::string CheckProjectInclude(std::string_view file, std::string_view include) {
  const std::string from = FolderOf(file);
  const std::string to = FolderOf(include);
  const std::string from_program = ProgramOf(file);
  const std::string to_program = ProgramOf(include);
  if (to_program == "tests") return "the product does not include its tests";
  if (to_program != "common" && to_program != from_program) {
    return from_program + " never includes " + to_program;
  }
  if (from == to || from == from_program + "/main.cc") return "";
  if (to == "common/wire" && !IsInsideAny(from, SeesMessages())) {
    return from + " may not include common/wire: it knows no messages";
  }
  for (const Island& island : Islands()) {
    if (IsInsideAny(from, island.folders) && to_program != "common" &&
        !IsInsideAny(to, island.folders)) {
      return from + " may not include " + to + ": " + island.why;
    }
  }
  const std::optional<size_t> from_layer = LayerNumber(from);
  const std::optional<size_t> to_layer = LayerNumber(to);
  if (!from_layer) return "the folder " + from + " has no layer yet: add it to one";
  if (!to_layer) return "the folder " + to + " has no layer yet: add it to one";
  if (*to_layer < *from_layer) return "";
  return from + " may not include " + to + ", which is not below it (" + Layers()[*to_layer].name +
         ")";
}

}  // namespace

std::string ForbiddenBecause(std::string_view file, std::string_view include) {
  if (IsProjectInclude(include)) return CheckProjectInclude(file, include);
  const std::string folder = FolderOf(file);
  for (const LibraryRule& rule : LibraryRules()) {
    const bool matches =
        std::any_of(rule.prefixes.begin(), rule.prefixes.end(),
                    [&](const std::string& prefix) { return StartsWith(include, prefix); });
    if (matches && !IsInsideAny(folder, rule.folders)) return folder + " may not see " + rule.name;
  }
  const bool pure = IsInside(folder, "server/solve") || IsInside(folder, "server/associate");
  for (const std::string_view header : {"fstream", "filesystem", "cstdio", "stdio.h"}) {
    if (pure && include == header) return folder + " knows no files";
  }
  return "";
}

std::vector<std::string> IncludesOf(std::string_view text) {
  static const std::regex kInclude(R"(^\s*#\s*include\s*["<]([^">]+)[">])");
  std::vector<std::string> includes;
  std::istringstream stream{std::string(text)};
  for (std::string line; std::getline(stream, line);) {
    std::smatch match;
    if (std::regex_search(line, match, kInclude)) includes.push_back(match[1]);
  }
  return includes;
}

}  // namespace rigcal::testing

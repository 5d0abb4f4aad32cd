// SPDX-License-Identifier: Apache-2.0
#include "tests/architecture/include_rules.h"

#include <algorithm>
#include <map>
#include <regex>
#include <set>
#include <sstream>

namespace rigcal::testing {

const FolderGraph& AllowedFolders() {
  static const auto* const kAllowed = new FolderGraph{
      {"agent/capture",
       {"agent/capture/preview", "agent/detect/blobs", "agent/detect/event", "agent/detect/frame",
        "agent/event", "common/camera", "common/import", "common/options", "common/status",
        "common/target", "common/text", "common/time"}},
      {"agent/capture/genicam",
       {"agent/capture", "agent/detect/blobs", "common/camera", "common/import", "common/options",
        "common/status", "common/time"}},
      {"agent/capture/learning",
       {"agent/capture", "agent/capture/preview", "agent/detect/frame", "common/file",
        "common/session", "common/status", "common/target", "common/text"}},
      {"agent/capture/metavision",
       {"agent/capture", "agent/event", "agent/event_files", "common/camera", "common/config",
        "common/import", "common/options", "common/status"}},
      {"agent/capture/preview", {"agent/detect/blobs", "agent/detect/frame", "common/session"}},
      {"agent/capture/recorded",
       {"agent/capture", "agent/event", "agent/event_files", "common/camera", "common/import",
        "common/options", "common/statistics", "common/status", "common/target", "common/text",
        "common/time"}},
      {"agent/capture/registry",
       {"agent/capture", "common/config", "common/options", "common/status", "common/text"}},
      {"agent/capture/simulated",
       {"agent/capture", "agent/event", "common/camera", "common/options",
        "common/simulation/events", "common/simulation/frames", "common/simulation/world",
        "common/status", "common/target", "common/time"}},
      {"agent/command",
       {"agent/capture", "agent/capture/registry", "agent/capture/simulated", "agent/detect/frame",
        "agent/event", "agent/event_files", "agent/uplink", "common/camera", "common/command_line",
        "common/config", "common/discovery", "common/enrolment", "common/file", "common/identity",
        "common/options", "common/statistics", "common/status", "common/target"}},
      {"agent/detect/blobs", {"common/statistics", "common/status", "common/target"}},
      {"agent/detect/event",
       {"agent/detect/blobs", "agent/event", "agent/identify", "common/statistics", "common/status",
        "common/target"}},
      {"agent/detect/frame",
       {"agent/detect/blobs", "agent/identify", "common/statistics", "common/status",
        "common/target"}},
      {"agent/event", {"common/camera", "common/status", "common/target", "common/time"}},
      {"agent/event_files", {"agent/event", "common/options", "common/status", "common/text"}},
      {"agent/identify",
       {"agent/detect/blobs", "common/camera", "common/statistics", "common/status",
        "common/target"}},
      {"agent/spool", {"common/session", "common/target", "common/time"}},
      {"agent/spool/disk",
       {"agent/spool", "common/failpoint", "common/session", "common/status", "common/target",
        "common/time"}},
      {"agent/stamp", {"agent/capture", "agent/spool", "common/status"}},
      {"agent/uplink",
       {"agent/capture", "agent/capture/learning", "agent/capture/preview", "agent/spool",
        "agent/stamp", "common/failpoint", "common/file", "common/status", "common/time",
        "common/wire"}},
      {"client", {"client/commands", "client/output", "client/watch"}},
      {"client/commands",
       {"client/net", "client/output", "client/results", "client/tables", "common/calibration",
        "common/command_line", "common/enrolment", "common/export", "common/file",
        "common/identity", "common/origin", "common/scale", "common/status", "common/target",
        "common/text", "common/triangulate", "common/wire"}},
      {"client/local",
       {"client/commands", "client/net", "client/output", "client/results", "client/tables",
        "common/calibration", "common/camera", "common/export", "common/import", "common/options",
        "common/simulation", "common/simulation/world", "common/status", "common/target",
        "common/wire"}},
      {"client/net", {"common/enrolment", "common/identity", "common/options", "common/wire"}},
      {"client/output", {"common/text"}},
      {"client/results",
       {"client/output", "common/calibration", "common/camera", "common/export", "common/file",
        "common/geometry", "common/import", "common/origin", "common/scale", "common/session",
        "common/simulation/world", "common/statistics", "common/status", "common/target",
        "common/text", "common/triangulate", "common/wire"}},
      {"client/tables", {"client/output", "common/geometry", "common/target", "common/wire"}},
      {"client/watch", {"client/commands", "client/local", "client/net", "client/output"}},
      {"common/associate", {"common/statistics"}},
      {"common/calibration",
       {"common/camera", "common/geometry", "common/status", "common/target", "common/time"}},
      {"common/camera",
       {"common/file", "common/geometry", "common/status", "common/text", "common/time"}},
      {"common/command_line", {"common/options", "common/text"}},
      {"common/config", {"common/options", "common/status", "common/text"}},
      {"common/discovery", {"common/enrolment", "common/identity", "common/status", "common/text"}},
      {"common/enrolment", {"common/identity", "common/status", "common/text"}},
      {"common/export",
       {"common/camera", "common/geometry", "common/status", "common/text", "common/time",
        "common/wire"}},
      {"common/failpoint", {}},
      {"common/file", {"common/status"}},
      {"common/geometry", {}},
      {"common/identity", {"common/file", "common/status", "common/text"}},
      {"common/import", {"common/camera", "common/geometry", "common/status", "common/text"}},
      {"common/log", {"common/text"}},
      {"common/options", {"common/status", "common/text"}},
      {"common/origin",
       {"common/calibration", "common/camera", "common/geometry", "common/status",
        "common/triangulate"}},
      {"common/scale", {"common/calibration", "common/status", "common/triangulate"}},
      {"common/session", {"common/camera", "common/status", "common/target", "common/time"}},
      {"common/simulation",
       {"common/options", "common/simulation/events", "common/simulation/frames",
        "common/simulation/world", "common/status"}},
      {"common/simulation/events",
       {"common/camera", "common/options", "common/simulation/frames", "common/simulation/world",
        "common/status", "common/target"}},
      {"common/simulation/frames",
       {"common/camera", "common/options", "common/simulation/world", "common/status",
        "common/target"}},
      {"common/simulation/world",
       {"common/camera", "common/geometry", "common/options", "common/status", "common/target"}},
      {"common/statistics", {}},
      {"common/status", {}},
      {"common/target", {"common/options", "common/status", "common/text"}},
      {"common/text", {}},
      {"common/time", {}},
      {"common/triangulate",
       {"common/associate", "common/calibration", "common/camera", "common/geometry",
        "common/statistics", "common/status", "common/target", "common/time"}},
      {"common/wire",
       {"common/calibration", "common/camera", "common/geometry", "common/identity",
        "common/session", "common/status", "common/target", "common/text"}},
      {"server/access", {"common/file", "common/identity", "common/status"}},
      {"server/api", {"common/text", "server/access"}},
      {"server/associate",
       {"common/associate", "common/camera", "common/session", "common/statistics", "common/status",
        "common/target", "common/time"}},
      {"server/audit", {}},
      {"server/care",
       {"common/file", "common/status", "common/text", "server/identity", "server/rpc",
        "server/store/sqlite"}},
      {"server/http",
       {"common/file", "common/identity", "common/status", "common/text", "server/access",
        "server/api", "server/audit", "server/identity", "server/listen"}},
      {"server/identity", {"common/file", "common/identity", "common/status", "common/text"}},
      {"server/ingest",
       {"common/camera", "common/failpoint", "common/session", "common/status", "server/store"}},
      {"server/estimate",
       {"common/camera", "common/session", "common/status", "server/jobs", "server/live",
        "server/session", "server/store"}},
      {"server/jobs",
       {"common/calibration", "common/session", "common/status", "common/wire", "server/session",
        "server/solve/running", "server/worker"}},
      {"server/listen", {"common/file", "common/status", "server/access", "server/audit"}},
      {"server/live",
       {"common/camera", "common/geometry", "common/session", "common/statistics", "common/status",
        "common/target", "common/time", "server/ingest", "server/session", "server/store"}},
      {"server/metrics", {"common/session", "server/ingest", "server/session", "server/store"}},
      {"server/monitor",
       {"common/calibration", "common/statistics", "common/status", "server/audit", "server/live",
        "server/session", "server/solve", "server/solve/evaluate", "server/store"}},
      {"server/rpc",
       {"common/export", "common/identity", "common/session", "common/status", "common/text",
        "common/triangulate", "common/wire", "server/access", "server/api", "server/audit",
        "server/identity", "server/ingest", "server/listen", "server/live", "server/session",
        "server/solve/evaluate", "server/store"}},
      {"server/session",
       {"common/calibration", "common/file", "common/session", "common/status", "common/text",
        "server/ingest", "server/solve", "server/store"}},
      {"server/solve",
       {"common/calibration", "common/camera", "common/origin", "common/scale", "common/statistics",
        "common/status", "common/target", "common/time", "common/triangulate", "server/associate",
        "server/solve/bundle", "server/solve/clocks", "server/solve/diagnose",
        "server/solve/evaluate", "server/solve/rig", "server/solve/running"}},
      {"server/solve/bundle", {"common/camera", "common/geometry", "common/status"}},
      {"server/solve/clocks",
       {"common/camera", "common/statistics", "common/status", "server/associate",
        "server/solve/geometry", "server/solve/rig"}},
      {"server/solve/diagnose",
       {"common/calibration", "common/camera", "common/statistics", "common/status", "common/time",
        "server/solve/bundle", "server/solve/clocks", "server/solve/evaluate",
        "server/solve/geometry", "server/solve/initialize", "server/solve/rig"}},
      {"server/solve/evaluate",
       {"common/calibration", "common/camera", "common/geometry", "common/statistics",
        "common/status", "server/solve/bundle", "server/solve/clocks", "server/solve/geometry",
        "server/solve/initialize", "server/solve/rig", "server/solve/trajectory"}},
      {"server/solve/geometry",
       {"common/camera", "common/geometry", "common/statistics", "server/solve/bundle"}},
      {"server/solve/initialize",
       {"common/statistics", "common/status", "server/associate", "server/solve/bundle",
        "server/solve/geometry"}},
      {"server/solve/rig",
       {"common/associate", "common/calibration", "common/camera", "common/geometry",
        "common/statistics", "common/status", "common/target", "server/associate",
        "server/solve/bundle", "server/solve/geometry", "server/solve/initialize",
        "server/solve/trajectory"}},
      {"server/solve/running",
       {"common/camera", "common/geometry", "common/statistics", "common/status", "common/target",
        "server/associate", "server/solve/bundle", "server/solve/clocks", "server/solve/evaluate",
        "server/solve/rig"}},
      {"server/solve/trajectory",
       {"common/camera", "common/statistics", "common/status", "server/solve/bundle"}},
      {"server/store", {"common/calibration", "common/session"}},
      {"server/store/factory", {"server/store", "server/store/sqlite"}},
      {"server/store/sqlite",
       {"common/calibration", "common/file", "common/session", "common/status", "common/target",
        "common/wire", "server/store"}},
      {"server/worker/main.cc", {"common/command_line", "common/wire", "server/worker"}},
      {"server/worker",
       {"common/calibration", "common/session", "common/status", "common/wire", "server/solve",
        "server/solve/running"}},
  };
  return *kAllowed;
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

std::string LayerOf(std::string_view path) { return std::string(path.substr(0, path.find('/'))); }

// An outside library, told by how its headers begin, and the folders that may see it.
struct LibraryRule {
  std::string name;
  std::vector<std::string> prefixes;
  std::set<std::string> folders;
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
      {"SQL", {"SQLiteCpp", "sqlite3", "soci"}, {"server/store/sqlite"}},
      {"Ceres", {"ceres/", "glog/"}, {"server/solve"}},
      {"OpenCV",
       {"opencv2/"},
       {"common/camera", "common/simulation/frames", "server/solve", "agent/capture",
        "agent/detect", "agent/identify", "agent/command"}},
      {"Aravis", {"arv", "glib"}, {"agent/capture/genicam"}},
      {"Avahi", {"avahi-"}, {"common/discovery"}},
      {"the Metavision SDK", {"metavision/"}, {"agent/capture/metavision"}},
      {"CLI11",
       {"CLI/"},
       {"client", "common/command_line", "agent/command", "agent/main.cc", "server/care",
        "server/main.cc", "server/worker/main.cc"}},
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
  for (const std::string_view layer : {"common/", "agent/", "server/", "client/", "tests/"}) {
    if (StartsWith(include, layer)) return true;
  }
  return false;
}

std::string CheckProjectInclude(std::string_view file, std::string_view include) {
  const std::string from = FolderOf(file);
  const std::string to = FolderOf(include);
  const std::string from_layer = LayerOf(file);
  const std::string to_layer = LayerOf(include);
  if (to_layer == "tests") return "the product does not include its tests";
  if (to_layer != "common" && to_layer != from_layer) {
    return from_layer + " never includes " + to_layer;
  }
  if (from == to || from == from_layer + "/main.cc") return "";
  const auto allowed = AllowedFolders().find(from);
  if (allowed == AllowedFolders().end()) return "the folder " + from + " has no rule yet: add one";
  if (!allowed->second.contains(to)) return from + " may not include " + to;
  return "";
}

// Depth first; `path` leads to `folder`.
std::string CycleFrom(const FolderGraph& graph, const std::string& folder,
                      std::vector<std::string> path, std::set<std::string>* done) {
  const auto before = std::find(path.begin(), path.end(), folder);
  if (before != path.end()) {
    std::string cycle;
    for (auto step = before; step != path.end(); ++step) cycle += *step + " -> ";
    return cycle + folder;
  }
  if (!done->insert(folder).second) return "";
  path.push_back(folder);
  const auto edges = graph.find(folder);
  if (edges == graph.end()) return "";
  for (const std::string& next : edges->second) {
    if (std::string cycle = CycleFrom(graph, next, path, done); !cycle.empty()) return cycle;
  }
  return "";
}

}  // namespace

std::string CycleOf(const FolderGraph& graph) {
  std::set<std::string> done;
  for (const auto& [folder, edges] : graph) {
    if (std::string cycle = CycleFrom(graph, folder, {}, &done); !cycle.empty()) return cycle;
  }
  return "";
}

std::string ForbiddenBecause(std::string_view file, std::string_view include) {
  if (IsProjectInclude(include)) return CheckProjectInclude(file, include);
  const std::string folder = FolderOf(file);
  for (const LibraryRule& rule : LibraryRules()) {
    const bool matches =
        std::any_of(rule.prefixes.begin(), rule.prefixes.end(),
                    [&](const std::string& prefix) { return StartsWith(include, prefix); });
    const bool allowed =
        std::any_of(rule.folders.begin(), rule.folders.end(),
                    [&](const std::string& outer) { return IsInside(folder, outer); });
    if (matches && !allowed) return folder + " may not see " + rule.name;
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

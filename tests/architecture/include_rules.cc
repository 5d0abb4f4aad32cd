// SPDX-License-Identifier: Apache-2.0
#include "tests/architecture/include_rules.h"

#include <algorithm>
#include <map>
#include <regex>
#include <set>
#include <sstream>

namespace rigcal::testing {
namespace {

// "server/solve/x.cc" -> "server/solve"; "client/x.cc" -> "client"; "agent/main.cc" ->
// "agent/main.cc".
std::string FolderOf(std::string_view path) {
  if (path.substr(0, 7) == "client/") return "client";
  const size_t first = path.find('/');
  if (first == std::string_view::npos) return "";
  const size_t second = path.find('/', first + 1);
  return std::string(path.substr(0, second));
}

std::string LayerOf(std::string_view path) { return std::string(path.substr(0, path.find('/'))); }

// Which folders a folder may include besides itself. A program's main.cc may include everything of
// its own layer and of common.
const std::map<std::string, std::set<std::string>>& AllowedFolders() {
  static const auto* const kAllowed = new std::map<std::string, std::set<std::string>>{
      {"common/status", {}},
      {"common/text", {}},
      {"common/time", {}},
      {"common/geometry", {}},
      {"common/camera", {"common/geometry", "common/status", "common/time"}},
      {"common/target", {"common/status", "common/text", "common/time"}},
      {"common/session", {"common/camera", "common/status", "common/target"}},
      {"common/calibration",
       {"common/camera", "common/geometry", "common/status", "common/target"}},
      {"common/simulation",
       {"common/camera", "common/geometry", "common/status", "common/target", "common/text",
        "common/time"}},
      {"common/config", {"common/camera", "common/status", "common/text"}},
      {"common/wire",
       {"common/calibration", "common/camera", "common/geometry", "common/session", "common/status",
        "common/target", "common/time"}},
      {"agent/capture",
       {"agent/detect", "agent/event", "common/camera", "common/config", "common/geometry",
        "common/session", "common/simulation", "common/status", "common/target", "common/text",
        "common/time"}},
      {"agent/event", {"common/camera", "common/status", "common/target", "common/time"}},
      {"agent/detect",
       {"agent/event", "common/camera", "common/geometry", "common/status", "common/target",
        "common/time"}},
      {"agent/uplink",
       {"agent/capture", "common/camera", "common/session", "common/status", "common/target",
        "common/time", "common/wire"}},
      {"agent/command",
       {"agent/capture", "agent/detect", "agent/event", "common/camera", "common/config",
        "common/geometry", "common/simulation", "common/status", "common/target", "common/time"}},
      {"server/store",
       {"common/calibration", "common/camera", "common/session", "common/status", "common/target",
        "common/time", "common/wire"}},
      {"server/ingest",
       {"common/camera", "common/session", "common/status", "common/target", "common/time",
        "server/store"}},
      {"server/associate",
       {"common/camera", "common/calibration", "common/geometry", "common/status", "common/target",
        "common/time"}},
      {"server/solve",
       {"common/camera", "common/calibration", "common/geometry", "common/status", "common/target",
        "common/time", "server/associate"}},
      {"server/session",
       {"common/calibration", "common/camera", "common/session", "common/status", "common/target",
        "common/time", "server/associate", "server/ingest", "server/solve", "server/store"}},
      {"server/rpc",
       {"common/calibration", "common/camera", "common/session", "common/status", "common/target",
        "common/time", "common/wire", "server/ingest", "server/session", "server/solve",
        "server/store"}},
      {"client",
       {"common/calibration", "common/camera", "common/geometry", "common/simulation",
        "common/session", "common/status", "common/target", "common/time", "common/wire"}},
  };
  return *kAllowed;
}

// An outside library, told by how its headers begin, and the folders that may see it.
struct LibraryRule {
  std::string name;
  std::vector<std::string> prefixes;
  std::set<std::string> folders;
};

const std::vector<LibraryRule>& LibraryRules() {
  static const auto* const kRules = new std::vector<LibraryRule>{
      {"gRPC and protobuf",
       {"grpc", "google/protobuf", "rigcal/v1/"},
       {"common/wire", "server/rpc", "agent/uplink", "client"}},
      {"TOML", {"toml++", "toml.hpp"}, {"common/config"}},
      {"YAML", {"yaml-cpp", "opencv2/core/persistence"}, {"common/camera"}},
      {"SQL", {"SQLiteCpp", "sqlite3", "soci"}, {"server/store"}},
      {"Ceres", {"ceres/", "glog/"}, {"server/solve"}},
      {"OpenCV",
       {"opencv2/"},
       {"common/camera", "server/solve", "agent/capture", "agent/detect", "agent/command"}},
      {"Aravis", {"arv", "glib"}, {"agent/capture"}},
      {"the Metavision SDK", {"metavision/"}, {"agent/capture"}},
      {"CLI11", {"CLI/"}, {"client", "agent/command", "agent/main.cc", "server/main.cc"}},
      {"HDF5", {"hdf5", "H5"}, {"agent/event"}},
      {"HTTP", {"boost/beast", "boost/asio"}, {"server/http"}},
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

}  // namespace

std::string ForbiddenBecause(std::string_view file, std::string_view include) {
  if (IsProjectInclude(include)) return CheckProjectInclude(file, include);
  const std::string folder = FolderOf(file);
  for (const LibraryRule& rule : LibraryRules()) {
    const bool matches =
        std::any_of(rule.prefixes.begin(), rule.prefixes.end(),
                    [&](const std::string& prefix) { return StartsWith(include, prefix); });
    if (matches && !rule.folders.contains(folder)) return folder + " may not see " + rule.name;
  }
  const bool pure = folder == "server/solve" || folder == "server/associate";
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

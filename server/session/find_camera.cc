// SPDX-License-Identifier: Apache-2.0
#include "server/session/find_camera.h"

#include <algorithm>
#include <set>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/status/status_macros.h"
#include "common/status/validate_name.h"

namespace rigcal::server {
namespace {

constexpr size_t kMaxListedCameras = 32;

bool Announces(const AgentRecord& agent, const std::string& camera) {
  return std::any_of(agent.cameras.begin(), agent.cameras.end(),
                     [&](const auto& announced) { return announced.description.camera == camera; });
}

// "connected are rig/left, rig/right".
std::string ConnectedText(const std::vector<AgentDirectory::ConnectedCamera>& cameras) {
  if (cameras.empty()) return "no agent is connected";
  std::set<std::string> names;
  for (const AgentDirectory::ConnectedCamera& camera : cameras) {
    names.insert(absl::StrCat(camera.rig, "/", camera.camera.description.camera));
  }
  const bool more = names.size() > kMaxListedCameras;
  while (names.size() > kMaxListedCameras) names.erase(std::prev(names.end()));
  return absl::StrCat("connected are ", absl::StrJoin(names, ", "), more ? " and others" : "");
}

}  // namespace

absl::StatusOr<AgentDirectory::ConnectedCamera> FindCamera(const AgentDirectory& directory,
                                                           const std::string& rig,
                                                           const std::string& camera) {
  RIGCAL_RETURN_IF_ERROR(ValidateName("camera", camera));
  if (!rig.empty()) RIGCAL_RETURN_IF_ERROR(ValidateName("rig", rig));
  std::vector<AgentDirectory::ConnectedCamera> found = directory.ConnectedCameras(rig);
  std::erase_if(found, [&](const auto& one) { return one.camera.description.camera != camera; });
  if (found.size() == 1) return std::move(found.front());
  if (found.size() > 1) {
    const std::string rigs =
        absl::StrJoin(found, ", ", [](std::string* out, const auto& one) { out->append(one.rig); });
    return absl::InvalidArgumentError(
        absl::StrCat("several rigs have a camera '", camera, "': ", rigs, "; name one of them"));
  }
  for (const AgentRecord& agent : directory.List(rig)) {
    if (!Announces(agent, camera)) continue;
    return absl::FailedPreconditionError(
        absl::StrCat("agent '", agent.agent_id, "' on host '", agent.host, "', which has camera '",
                     agent.rig, "/", camera, "', is not connected; start it again"));
  }
  return absl::NotFoundError(absl::StrCat("no agent has a camera '", rig, rig.empty() ? "" : "/",
                                          camera, "'; ",
                                          ConnectedText(directory.ConnectedCameras(""))));
}

}  // namespace rigcal::server

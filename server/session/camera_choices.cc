// SPDX-License-Identifier: Apache-2.0
#include "server/session/camera_choices.h"

#include <algorithm>
#include <optional>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/status/status_macros.h"
#include "common/status/validate_name.h"
#include "common/text/printable.h"

namespace rigcal::server {

void CameraChoices::TakeOffer(AgentDirectory::Registration registration,
                              const std::string& agent_id, std::vector<OfferedCamera> cameras) {
  const std::lock_guard lock(mutex_);
  Offer& offer = offers_[agent_id];
  // A stream that another one has replaced may end later than that one begins.
  if (registration < offer.registration) return;
  offer = {.registration = registration, .cameras = std::move(cameras)};
}

std::vector<OfferedCamera> CameraChoices::OffersOf(std::string_view agent_id) const {
  const std::lock_guard lock(mutex_);
  const auto found = offers_.find(agent_id);
  return found == offers_.end() ? std::vector<OfferedCamera>() : found->second.cameras;
}

void CameraChoices::AgentGone(AgentDirectory::Registration registration) {
  questions_.AgentGone(registration);
  const std::lock_guard lock(mutex_);
  std::erase_if(offers_,
                [&](const auto& offer) { return offer.second.registration == registration; });
}

absl::StatusOr<std::string> CameraChoices::AgentWith(const std::string& device) const {
  const std::lock_guard lock(mutex_);
  std::vector<std::string> agents;
  std::vector<std::string> devices;
  for (const auto& [agent_id, offer] : offers_) {
    for (const OfferedCamera& camera : offer.cameras) {
      devices.push_back(absl::StrCat(agent_id, "/", camera.device));
      if (camera.device == device) agents.push_back(agent_id);
    }
  }
  if (agents.size() == 1) return agents.front();
  if (!agents.empty()) {
    return absl::InvalidArgumentError(absl::StrCat("several agents offer a camera '", device,
                                                   "': ", absl::StrJoin(agents, ", "),
                                                   "; name one of them"));
  }
  constexpr size_t kMostNamed = 32;
  const bool more = devices.size() > kMostNamed;
  devices.resize(std::min(devices.size(), kMostNamed));
  return absl::NotFoundError(absl::StrCat(
      "no agent offers a camera '", Printable(Beginning(device, 64)), "'; ",
      devices.empty()
          ? "none is offered: is the agent running, and of this release?"
          : absl::StrCat("there are ", absl::StrJoin(devices, ", "), more ? " and others" : "")));
}

absl::Status CameraChoices::CheckName(const AgentDirectory::ConnectedAgent& agent,
                                      const std::string& camera) const {
  std::string owner = registry_ == nullptr ? "" : registry_->OwnerOf(agent.rig, camera);
  for (const auto& connected : directory_.ConnectedCameras(agent.rig)) {
    if (connected.camera.description.camera == camera) owner = connected.agent_id;
  }
  if (owner.empty() || owner == agent.agent_id) return absl::OkStatus();
  return absl::AlreadyExistsError(
      absl::StrCat("camera '", agent.rig, "/", camera, "' belongs to agent '", owner,
                   "'; give another name, or drop it there and move its name: rigcal camera move ",
                   camera, " ", agent.agent_id));
}

absl::StatusOr<CameraChoices::Chosen> CameraChoices::Ask(
    const std::string& agent_id, ChoiceRequest request, const std::function<bool()>& is_cancelled) {
  const std::optional<AgentDirectory::ConnectedAgent> agent = directory_.FindAgent(agent_id);
  if (!agent) {
    std::vector<std::string> others;
    {
      const std::lock_guard lock(mutex_);
      for (const auto& [other, offer] : offers_) others.push_back(other);
    }
    return absl::FailedPreconditionError(absl::StrCat(
        "agent '", Printable(Beginning(agent_id, 64)),
        "' is not connected; start it, and ask again. ",
        others.empty() ? "No agent offers cameras now"
                       : absl::StrCat("Cameras are offered by ", absl::StrJoin(others, ", "))));
  }
  if (!request.device.empty()) RIGCAL_RETURN_IF_ERROR(CheckName(*agent, request.camera));
  RIGCAL_ASSIGN_OR_RETURN(
      request.request_id,
      questions_.Enter(absl::StrCat(agent->rig, "/", request.camera), agent->registration));
  agent->link->SendChoiceRequest(request);
  RIGCAL_ASSIGN_OR_RETURN(
      const ChoiceAnswer answer,
      questions_.Await(request.request_id, options_.longest_wait, is_cancelled));
  RIGCAL_RETURN_IF_ERROR(answer.status);
  return Chosen{agent_id, agent->rig};
}

absl::StatusOr<CameraChoices::Chosen> CameraChoices::Use(
    const std::string& agent_id, ChoiceRequest request, const std::function<bool()>& is_cancelled) {
  RIGCAL_RETURN_IF_ERROR(ValidateName("camera", request.camera));
  if (request.device.empty()) {
    return absl::InvalidArgumentError("device: is empty; `rigcal cameras` shows what is offered");
  }
  std::string asked = agent_id;
  if (asked.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(asked, AgentWith(request.device));
  } else {
    RIGCAL_RETURN_IF_ERROR(ValidateName("agent id", asked));
    const std::vector<OfferedCamera> offers = OffersOf(asked);
    if (directory_.FindAgent(asked) &&
        std::ranges::find(offers, request.device, &OfferedCamera::device) == offers.end()) {
      const std::string names = absl::StrJoin(
          offers, ", ",
          [](std::string* out, const OfferedCamera& one) { out->append(one.device); });
      return absl::NotFoundError(absl::StrCat(
          "agent '", asked, "' offers no camera '", Printable(Beginning(request.device, 64)), "'; ",
          names.empty() ? "it offers none" : "it offers ", names));
    }
  }
  return Ask(asked, std::move(request), is_cancelled);
}

absl::StatusOr<CameraChoices::Chosen> CameraChoices::Drop(
    const std::string& rig, const std::string& camera, const std::function<bool()>& is_cancelled) {
  RIGCAL_RETURN_IF_ERROR(ValidateName("camera", camera));
  // Also one that is gone, which its agent does not announce.
  std::vector<std::string> agents;
  {
    const std::lock_guard lock(mutex_);
    for (const auto& [agent_id, offer] : offers_) {
      for (const OfferedCamera& one : offer.cameras) {
        if (one.camera == camera) agents.push_back(agent_id);
      }
    }
  }
  if (!rig.empty()) {
    std::erase_if(agents, [&](const std::string& agent_id) {
      const auto agent = directory_.FindAgent(agent_id);
      return !agent || agent->rig != rig;
    });
  }
  if (agents.empty()) {
    return absl::NotFoundError(absl::StrCat("no connected agent has chosen a camera '", camera,
                                            "'; `rigcal cameras` shows those there are"));
  }
  if (agents.size() > 1) {
    return absl::InvalidArgumentError(absl::StrCat("several agents have a camera '", camera, "': ",
                                                   absl::StrJoin(agents, ", "), "; name the rig"));
  }
  return Ask(agents.front(), {.camera = camera}, is_cancelled);
}

}  // namespace rigcal::server

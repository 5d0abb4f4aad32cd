// SPDX-License-Identifier: Apache-2.0
#include "server/session/agent_registry.h"

#include <openssl/sha.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/file/durable_file.h"
#include "common/status/status_macros.h"
#include "common/status/validate_name.h"
#include "common/text/nesting.h"

namespace rigcal::server {
namespace {

namespace fs = std::filesystem;

}  // namespace

std::string CredentialOf(std::string_view secret) {
  if (secret.empty()) return "";
  std::array<unsigned char, SHA256_DIGEST_LENGTH> hash{};
  SHA256(reinterpret_cast<const unsigned char*>(secret.data()), secret.size(), hash.data());
  return absl::BytesToHexString(
      absl::string_view(reinterpret_cast<const char*>(hash.data()), hash.size()));
}

absl::StatusOr<std::unique_ptr<AgentRegistry>> AgentRegistry::Open(AgentRegistryOptions options) {
  std::unique_ptr<AgentRegistry> registry(new AgentRegistry(std::move(options)));
  RIGCAL_RETURN_IF_ERROR(registry->Read());
  return registry;
}

absl::Status AgentRegistry::Read() {
  std::error_code error;
  if (options_.file.empty() || !fs::exists(options_.file, error)) return absl::OkStatus();
  try {
    std::ifstream stream(options_.file);
    const std::string text{std::istreambuf_iterator<char>(stream), {}};
    const auto file = ParseJson<nlohmann::json>(text);
    for (const nlohmann::json& agent : file.at("agents")) {
      installations_[agent.at("agent_id")] = {.credential = agent.at("secret_sha256"),
                                              .host = agent.at("host")};
    }
    for (const nlohmann::json& camera : file.at("cameras")) {
      owners_[{camera.at("rig"), camera.at("camera")}] = camera.at("agent_id");
    }
  } catch (const std::exception& fault) {
    return absl::DataLossError(absl::StrCat(
        options_.file.string(), " is damaged: ", fault.what(),
        "; restore it from a backup, or remove it: then every camera belongs to the first agent ",
        "that announces it"));
  }
  return absl::OkStatus();
}

absl::Status AgentRegistry::CheckInstallationHeld(std::string_view agent_id,
                                                  std::string_view credential,
                                                  std::string_view host) const {
  if (credential.starts_with(kCertificateCredential)) return absl::OkStatus();
  const auto known = installations_.find(agent_id);
  if (known == installations_.end() || known->second.credential == credential) {
    return absl::OkStatus();
  }
  return absl::AlreadyExistsError(absl::StrCat(
      "agent '", std::string(agent_id), "' on host '", absl::CHexEscape(std::string(host)),
      "' is refused: the id belongs to the installation on host '",
      absl::CHexEscape(known->second.host),
      "', which keeps another secret; give each agent its own state directory and --agent-id"));
}

absl::Status AgentRegistry::CheckHeld(const AgentRecord& agent) const {
  RIGCAL_RETURN_IF_ERROR(CheckInstallationHeld(agent.agent_id, agent.credential, agent.host));
  for (const AnnouncedCamera& camera : agent.cameras) {
    const std::string& name = camera.description.camera;
    const auto owner = owners_.find({agent.rig, name});
    if (owner == owners_.end() || owner->second == agent.agent_id) continue;
    return absl::AlreadyExistsError(absl::StrCat(
        "camera '", agent.rig, "/", name, "' belongs to agent '", owner->second, "', and agent '",
        agent.agent_id, "' on host '", absl::CHexEscape(agent.host),
        "' announces it; give the camera another name, or move it with: rigcal camera move ", name,
        " ", agent.agent_id, " --rig ", agent.rig));
  }
  return absl::OkStatus();
}

absl::Status AgentRegistry::CheckInstallation(std::string_view agent_id,
                                              std::string_view credential,
                                              std::string_view host) const {
  std::lock_guard lock(mutex_);
  return CheckInstallationHeld(agent_id, credential, host);
}

absl::Status AgentRegistry::Check(const AgentRecord& agent) const {
  std::lock_guard lock(mutex_);
  return CheckHeld(agent);
}

absl::Status AgentRegistry::Remember(const AgentRecord& agent) {
  std::lock_guard lock(mutex_);
  RIGCAL_RETURN_IF_ERROR(CheckHeld(agent));
  Installations installations = installations_;
  Owners owners = owners_;
  std::string_view secret = agent.credential;
  const bool has_certificate = secret.starts_with(kCertificateCredential);
  if (has_certificate) secret.remove_prefix(kCertificateCredential.size());
  const auto known = installations.find(agent.agent_id);
  // A certificate for the name takes it from who had it without one.
  const bool is_news = !secret.empty() && (known == installations.end() ||
                                           (has_certificate && known->second.credential != secret));
  if (is_news) installations[agent.agent_id] = {std::string(secret), agent.host};
  for (const AnnouncedCamera& camera : agent.cameras) {
    owners.insert({{agent.rig, camera.description.camera}, agent.agent_id});
  }
  if (!is_news && owners.size() == owners_.size()) return absl::OkStatus();
  const auto own = std::ranges::count(owners, agent.agent_id, &Owners::value_type::second);
  if (static_cast<size_t>(own) > options_.max_cameras_per_agent ||
      installations.size() > options_.max_agents) {
    return absl::ResourceExhaustedError(absl::StrCat(
        "agent '", agent.agent_id, "' is refused: ", own, " cameras were announced by it so far, ",
        installations.size(), " agents are known; at most ", options_.max_cameras_per_agent,
        " and ", options_.max_agents, " are allowed"));
  }
  return Save(std::move(installations), std::move(owners));
}

std::string AgentRegistry::HolderOf(std::string_view agent_id) const {
  constexpr size_t kNamedCameras = 3;
  std::lock_guard lock(mutex_);
  const auto known = installations_.find(agent_id);
  std::vector<std::string> cameras;
  for (const auto& [camera, owner] : owners_) {
    if (owner == agent_id) cameras.push_back(absl::StrCat(camera.first, "/", camera.second));
  }
  if (known == installations_.end() && cameras.empty()) return "";
  const size_t count = cameras.size();
  cameras.resize(std::min(count, kNamedCameras));
  return absl::StrCat(
      known == installations_.end()
          ? ""
          : absl::StrCat("on host '", absl::CHexEscape(known->second.host), "'",
                         count == 0 ? "" : ", "),
      count == 0 ? "" : absl::StrCat("with camera ", absl::StrJoin(cameras, ", ")),
      count > kNamedCameras ? absl::StrCat(" and ", count - kNamedCameras, " more") : "");
}

absl::StatusOr<bool> AgentRegistry::Forget(std::string_view agent_id) {
  std::lock_guard lock(mutex_);
  Installations installations = installations_;
  Owners owners = owners_;
  size_t forgotten = std::erase_if(owners, [&](const auto& own) { return own.second == agent_id; });
  forgotten += std::erase_if(installations, [&](const auto& own) { return own.first == agent_id; });
  if (forgotten == 0) return false;
  RIGCAL_RETURN_IF_ERROR(Save(std::move(installations), std::move(owners)));
  return true;
}

std::string AgentRegistry::OwnerOf(std::string_view rig, std::string_view camera) const {
  std::lock_guard lock(mutex_);
  const auto owner = owners_.find({std::string(rig), std::string(camera)});
  return owner == owners_.end() ? "" : owner->second;
}

absl::StatusOr<std::string> AgentRegistry::Move(const std::string& rig, const std::string& camera,
                                                const std::string& agent_id) {
  RIGCAL_RETURN_IF_ERROR(ValidateName("rig", rig));
  RIGCAL_RETURN_IF_ERROR(ValidateName("camera", camera));
  RIGCAL_RETURN_IF_ERROR(ValidateName("agent_id", agent_id));
  std::lock_guard lock(mutex_);
  Owners owners = owners_;
  std::string before = std::exchange(owners[{rig, camera}], agent_id);
  if (before == agent_id) return before;
  const auto own = std::ranges::count(owners, agent_id, &Owners::value_type::second);
  if (static_cast<size_t>(own) > options_.max_cameras_per_agent) {
    return absl::ResourceExhaustedError(
        absl::StrCat("agent '", agent_id, "' has ", own - 1, " cameras, which is the limit"));
  }
  RIGCAL_RETURN_IF_ERROR(Save(installations_, std::move(owners)));
  return before;
}

absl::Status AgentRegistry::Save(Installations installations, Owners owners) {
  if (!options_.file.empty()) {
    auto agents = nlohmann::ordered_json::array();
    for (const auto& [agent_id, installation] : installations) {
      agents.push_back({{"agent_id", agent_id},
                        {"secret_sha256", installation.credential},
                        {"host", installation.host}});
    }
    auto cameras = nlohmann::ordered_json::array();
    for (const auto& [camera, agent_id] : owners) {
      cameras.push_back({{"rig", camera.first}, {"camera", camera.second}, {"agent_id", agent_id}});
    }
    const nlohmann::ordered_json file = {{"agents", agents}, {"cameras", cameras}};
    RIGCAL_RETURN_IF_ERROR(WriteDurableFile(
        options_.file, file.dump(1, ' ', true, nlohmann::json::error_handler_t::replace) + "\n"));
  }
  installations_ = std::move(installations);
  owners_ = std::move(owners);
  return absl::OkStatus();
}

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/session/agent.h"

namespace rigcal::server {

struct AgentRegistryOptions {
  std::filesystem::path file = {};  // empty: in memory only
  size_t max_agents = 10'000;
  size_t max_cameras_per_agent = 256;  // all that ever were its own
};

// Proof that a stream is of a certain installation of an agent (AgentRecord::credential), from the
// secret that the installation keeps. Empty for an empty secret.
std::string CredentialOf(std::string_view secret);
// How the credential of an agent begins whose certificate names it; CredentialOf its secret
// follows.
inline constexpr std::string_view kCertificateCredential = "certificate";

// What a server remembers of agents for good: which installation an agent_id belongs to, and which
// agent a camera. Both belong to the first one that came, a camera until it is moved; an agent_id
// to the one with a certificate for it, if there is one. Kept in a JSON file. Thread-safe.
class AgentRegistry {
 public:
  // DATA_LOSS: the file is damaged; it is named.
  static absl::StatusOr<std::unique_ptr<AgentRegistry>> Open(AgentRegistryOptions options);

  // ALREADY_EXISTS: the agent_id is that of another installation; both hosts are named. An
  // agent_id that is new, or has a certificate, is OK.
  absl::Status CheckInstallation(std::string_view agent_id, std::string_view credential,
                                 std::string_view host) const;
  // The same, and ALREADY_EXISTS for a camera of another agent, which is named.
  absl::Status Check(const AgentRecord& agent) const;
  // Check, and remembers what is new. Returns when it is on disk, with the errors of writing it.
  absl::Status Remember(const AgentRecord& agent);

  // Who has an agent_id, for messages: "on host 'pc-7', with camera rig/left". Empty: nobody.
  std::string HolderOf(std::string_view agent_id) const;
  // Its agent_id and cameras belong to whoever comes first from now on. False: it is not known.
  absl::StatusOr<bool> Forget(std::string_view agent_id);

  // Empty: the camera has no agent.
  std::string OwnerOf(std::string_view rig, std::string_view camera) const;
  // Gives a camera to another agent, also to one that was never connected; returns whose it was.
  // INVALID_ARGUMENT: a name is not valid. RESOURCE_EXHAUSTED: the agent has too many cameras.
  absl::StatusOr<std::string> Move(const std::string& rig, const std::string& camera,
                                   const std::string& agent_id);

 private:
  struct Installation {
    std::string credential;
    std::string host;
  };
  using Installations = std::map<std::string, Installation, std::less<>>;
  using Owners = std::map<std::pair<std::string, std::string>, std::string>;  // (rig, camera)

  explicit AgentRegistry(AgentRegistryOptions options) : options_(std::move(options)) {}
  absl::Status Read();
  // With mutex_ held.
  absl::Status CheckHeld(const AgentRecord& agent) const;
  absl::Status CheckInstallationHeld(std::string_view agent_id, std::string_view credential,
                                     std::string_view host) const;
  // Takes them when they are on disk.
  absl::Status Save(Installations installations, Owners owners);

  const AgentRegistryOptions options_;
  mutable std::mutex mutex_;
  Installations installations_;
  Owners owners_;
};

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/identity/certificate.h"

namespace rigcal {

// A peer's certificate and where its servers are.
struct PeerIdentity {
  std::string ca_pem;
  std::string certificate_pem;
  std::string key_pem;
  std::vector<std::string> grpc;   // HOST:PORT
  std::vector<std::string> https;  // HOST:PORT

  friend bool operator==(const PeerIdentity&, const PeerIdentity&) = default;
};

// {"grpc": [...], "https": [...]}, and back. INVALID_ARGUMENT: it is not that.
std::string FormatServers(const PeerIdentity& identity);
absl::Status ParseServers(std::string_view text, PeerIdentity* identity);

// OK if the certificate is of this CA and belongs to the key, and both texts hold one certificate
// and nothing else: everybody whose certificate stood beside the CA's would be trusted.
absl::Status CheckIdentity(const PeerIdentity& identity);

// The folder "identity" of an agent (files agent.crt, agent.key) or a user (user.crt, user.key),
// with ca.crt and servers.json, and "asked", an empty file whose time counts. Files 0600, folder
// 0700.
class IdentityFolder {
 public:
  static IdentityFolder OfAgent(const std::filesystem::path& state_dir) {
    return {state_dir / "identity", "agent"};
  }
  static IdentityFolder OfUser(const std::filesystem::path& config_dir) {
    return {config_dir.empty() ? std::filesystem::path() : config_dir / "identity", "user"};
  }
  // With files STEM.crt and STEM.key.
  static IdentityFolder In(const std::filesystem::path& folder, std::string_view stem) {
    return {folder, stem};
  }

  const std::filesystem::path& path() const { return path_; }
  bool Exists() const;
  // As CheckIdentity has checked it. NOT_FOUND: there is none. FAILED_PRECONDITION: it is damaged,
  // or trusts more than one certificate; the message says what to do.
  absl::StatusOr<PeerIdentity> Load() const;
  // A new identity in the place of the old: checked, then all files at once or none.
  absl::Status Replace(const PeerIdentity& identity) const;
  // A renewed certificate for the same key: checked, then replaced, with the list of servers.
  absl::Status Renew(const PeerIdentity& identity) const;
  // When a server was last asked whether the certificate is due, by the clock of this PC, whatever
  // the answer. None: never.
  std::optional<absl::Time> Asked() const;
  void NoteAsked() const;

 private:
  IdentityFolder(std::filesystem::path path, std::string_view stem)
      : path_(std::move(path)), stem_(stem) {}

  absl::Status WriteFiles(const PeerIdentity& identity, const std::filesystem::path& folder) const;

  std::filesystem::path path_;
  std::string stem_;
};

// Of the agents whose state is where this user's agents keep it by default: below
// $XDG_STATE_HOME/rigcal/agent, else ~/.local/state/rigcal/agent. Only those that exist, sorted.
std::vector<IdentityFolder> DefaultAgentIdentities();

// $XDG_CONFIG_HOME/rigcal, else ~/.config/rigcal. Empty: neither variable is set.
std::filesystem::path UserConfigFolder();

}  // namespace rigcal

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>

#include "absl/status/statusor.h"
#include "common/file/file_descriptor.h"

namespace rigcal::agent {

// The agent's identity over all its runs, and the number of this one.
struct AgentIdentity {
  std::string agent_id;
  std::string secret;  // proves to a server that it is this installation; 64 hexadecimal digits
  uint32_t incarnation = 0;  // grows at each start
  // Of the streams that begin in this run. Random, so that the copy of a disk in another PC does
  // not number other observations as this one does; never one of the last runs' again.
  uint32_t stream_epoch = 1;
};

// The agent's folder: its identity, and a lock against a second agent while this object lives.
// Everything in it survives power loss once Open has returned.
class AgentState {
 public:
  // Creates the folder where it is missing, locks it, and counts the incarnation up. `agent_id`:
  // this one from now on; empty: the one from before, or at the first start one made of the host's
  // name and a random number.
  //   ALREADY_EXISTS       another agent uses the folder; the message says what to do
  //   DATA_LOSS            a file in it is damaged; it is named
  //   INVALID_ARGUMENT     the agent_id is not a valid name
  //   FAILED_PRECONDITION  the folder, or something of the agent's in it, belongs to another user
  //   others               errors of the file system, naming the path
  static absl::StatusOr<AgentState> Open(const std::filesystem::path& directory,
                                         const std::string& agent_id);
  // $XDG_STATE_HOME/rigcal/agent/NAME, or ~/.local/state/rigcal/agent/NAME, with `agent_id` or
  // "default" as NAME. FAILED_PRECONDITION: neither variable is set.
  static absl::StatusOr<std::filesystem::path> DefaultDirectory(const std::string& agent_id);

  const AgentIdentity& identity() const { return identity_; }

 private:
  explicit AgentState(FileDescriptor lock) : lock_(std::move(lock)) {}

  FileDescriptor lock_;
  AgentIdentity identity_;
};

// Name of this PC, as far as it can be part of an agent_id: letters, digits, '-'.
std::string HostName();

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
#include "agent/uplink/agent_state.h"

#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <random>
#include <sstream>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "common/file/durable_file.h"
#include "common/file/file_error.h"
#include "common/file/private_folder.h"
#include "common/status/status_macros.h"
#include "common/status/validate_name.h"

namespace rigcal::agent {
namespace {

constexpr char kStateFile[] = "agent.state";
constexpr char kLockFile[] = "lock";
constexpr char kSecretFile[] = "agent.secret";
constexpr size_t kSecretDigits = 64;
constexpr size_t kRememberedEpochs = 64;

// What the file holds.
struct StoredState {
  AgentIdentity identity;
  std::vector<uint32_t> stream_epochs;  // of the last runs, the newest last
};

absl::StatusOr<FileDescriptor> Lock(const std::filesystem::path& directory) {
  const std::filesystem::path path = directory / kLockFile;
  RIGCAL_ASSIGN_OR_RETURN(FileDescriptor file, OpenPrivateFile(path));
  // The kernel releases it when the process ends, however that happens.
  if (flock(file.get(), LOCK_EX | LOCK_NB) == 0) return file;
  if (errno != EWOULDBLOCK) return FileError("lock", path, errno);
  return absl::AlreadyExistsError(absl::StrCat("another agent uses the state directory ",
                                               directory.string(),
                                               "; stop it, or give this one another --state-dir"));
}

// 31 bits, so that it stays a positive number wherever it is shown.
uint32_t NewStreamEpoch(const std::vector<uint32_t>& used) {
  std::random_device random;
  uint32_t epoch = 0;
  while (epoch == 0 || std::ranges::find(used, epoch) != used.end()) epoch = random() >> 1;
  return epoch;
}

// `key=value` lines. Incarnation 0: there is no file yet.
absl::StatusOr<StoredState> Load(const std::filesystem::path& path) {
  StoredState state;
  AgentIdentity& identity = state.identity;
  std::error_code error;
  if (!std::filesystem::exists(path, error)) {
    if (!error) return state;
    return absl::UnavailableError(
        absl::StrCat("cannot read ", path.string(), ": ", error.message()));
  }
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  for (const absl::string_view line : absl::StrSplit(text.str(), '\n')) {
    const std::pair<std::string, std::string> pair = absl::StrSplit(line, absl::MaxSplits('=', 1));
    if (pair.first == "agent_id") identity.agent_id = pair.second;
    if (pair.first == "incarnation" && !absl::SimpleAtoi(pair.second, &identity.incarnation)) {
      identity.incarnation = 0;
    }
    if (pair.first != "stream_epochs") continue;
    for (const absl::string_view word : absl::StrSplit(pair.second, ',', absl::SkipEmpty())) {
      // A damaged one cannot be met again.
      uint32_t epoch = 0;
      if (absl::SimpleAtoi(word, &epoch)) state.stream_epochs.push_back(epoch);
    }
  }
  constexpr uint32_t kLast = std::numeric_limits<uint32_t>::max();
  if (identity.incarnation == 0 || identity.incarnation == kLast ||
      !ValidateName("agent_id", identity.agent_id).ok()) {
    return absl::DataLossError(
        absl::StrCat(path.string(),
                     " is damaged: it must hold agent_id=NAME and incarnation=NUMBER; remove "
                     "the file to start as a new agent"));
  }
  return state;
}

absl::Status Save(const std::filesystem::path& directory, const StoredState& state) {
  return WriteDurableFile(
      directory / kStateFile,
      absl::StrCat("agent_id=", state.identity.agent_id,
                   "\nincarnation=", state.identity.incarnation,
                   "\nstream_epochs=", absl::StrJoin(state.stream_epochs, ","), "\n"));
}

// Made at the first start, readable for this user only.
absl::StatusOr<std::string> LoadOrMakeSecret(const std::filesystem::path& directory) {
  const std::filesystem::path path = directory / kSecretFile;
  std::string secret;
  if (std::ifstream file(path); file >> secret) {
    if (secret.size() == kSecretDigits) return secret;
    return absl::DataLossError(
        absl::StrCat(path.string(),
                     " is damaged; restore it, or remove it and give the agent a new --agent-id"));
  }
  std::array<unsigned char, kSecretDigits / 2> bytes{};
  if (getentropy(bytes.data(), bytes.size()) != 0) {
    return FileError("make random numbers for", path, errno);
  }
  secret.clear();
  for (const unsigned char byte : bytes) absl::StrAppendFormat(&secret, "%02x", byte);
  RIGCAL_RETURN_IF_ERROR(WriteDurableFile(path, secret + "\n"));
  return secret;
}

}  // namespace

std::string HostName() {
  std::array<char, 256> buffer{};
  if (gethostname(buffer.data(), buffer.size() - 1) != 0) return "host";
  std::string name(buffer.data());
  name.resize(std::min(name.find('.'), name.size()));
  std::replace_if(
      name.begin(), name.end(),
      [](char c) { return !absl::ascii_isalnum(static_cast<unsigned char>(c)); }, '-');
  return name.empty() ? "host" : name;
}

// The host's; of an agent with a state directory of its own, beside others on the same host, with
// the name of that.
std::string NameFor(const std::filesystem::path& directory) {
  const absl::StatusOr<std::filesystem::path> usual = AgentState::DefaultDirectory("");
  std::error_code error;
  const std::filesystem::path own = std::filesystem::absolute(directory, error).lexically_normal();
  if (usual.ok() && own == std::filesystem::absolute(*usual, error).lexically_normal()) {
    return HostName().substr(0, 64);
  }
  std::string folder = own.has_filename() ? own.filename() : own.parent_path().filename();
  std::replace_if(
      folder.begin(), folder.end(),
      [](char c) { return !absl::ascii_isalnum(static_cast<unsigned char>(c)); }, '-');
  return absl::StrCat(HostName().substr(0, 31), "-", folder.substr(0, 32));
}

absl::StatusOr<AgentState> AgentState::Open(const std::filesystem::path& directory,
                                            const std::string& agent_id) {
  if (!agent_id.empty()) RIGCAL_RETURN_IF_ERROR(ValidateName("agent_id", agent_id));
  RIGCAL_RETURN_IF_ERROR(MakePrivateFolder(directory));
  // Others may have put these here while they could.
  for (const char* name :
       {kStateFile, kSecretFile, "identity", "spool", "detectors", "cameras.json", "lenses"}) {
    RIGCAL_RETURN_IF_ERROR(CheckOwner(directory / name));
  }
  RIGCAL_ASSIGN_OR_RETURN(FileDescriptor lock, Lock(directory));
  RemoveUnfinishedFiles(directory);
  AgentState state(std::move(lock));
  RIGCAL_ASSIGN_OR_RETURN(StoredState stored, Load(directory / kStateFile));
  AgentIdentity& identity = stored.identity;
  if (!agent_id.empty()) identity.agent_id = agent_id;
  if (identity.agent_id.empty()) identity.agent_id = NameFor(directory);
  RIGCAL_ASSIGN_OR_RETURN(identity.secret, LoadOrMakeSecret(directory));
  ++identity.incarnation;
  identity.stream_epoch = NewStreamEpoch(stored.stream_epochs);
  stored.stream_epochs.push_back(identity.stream_epoch);
  if (stored.stream_epochs.size() > kRememberedEpochs) {
    stored.stream_epochs.erase(stored.stream_epochs.begin());
  }
  RIGCAL_RETURN_IF_ERROR(Save(directory, stored));
  state.identity_ = std::move(identity);
  return state;
}

absl::StatusOr<std::filesystem::path> AgentState::DefaultDirectory(const std::string& agent_id) {
  const std::filesystem::path name = agent_id.empty() ? "default" : agent_id;
  for (const auto& [variable, below] :
       {std::pair{"XDG_STATE_HOME", ""}, {"HOME", ".local/state"}}) {
    const char* const folder = std::getenv(variable);
    // The XDG specification says to ignore a relative path there.
    if (folder == nullptr || folder[0] != '/') continue;
    return std::filesystem::path(folder) / below / "rigcal" / "agent" / name;
  }
  return absl::FailedPreconditionError(
      "neither XDG_STATE_HOME nor HOME is set: give --state-dir DIR");
}

}  // namespace rigcal::agent

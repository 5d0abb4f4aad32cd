// SPDX-License-Identifier: Apache-2.0
#include "agent/uplink/known_servers.h"

#include <fstream>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/file/durable_file.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {

absl::StatusOr<KnownServers> KnownServers::Open(std::filesystem::path file) {
  KnownServers known(std::move(file));
  std::error_code error;
  if (!std::filesystem::exists(known.file_, error)) return known;
  std::ifstream stream(known.file_);
  if (stream >> known.last_.id >> known.last_.generation) return known;
  return absl::DataLossError(
      absl::StrCat(known.file_.string(),
                   " is damaged: it must hold a server's id and its generation; remove it if no "
                   "standby has ever taken over from this agent's server"));
}

absl::Status KnownServers::Meet(const std::string& address, const std::string& id,
                                uint64_t generation) {
  if (generation == 0) return absl::OkStatus();
  if (id == last_.id && generation < last_.generation) {
    return absl::FailedPreconditionError(absl::StrCat(
        "server ", address, " has generation ", generation, ", and this agent has spoken with ",
        "generation ", last_.generation, " of it: a standby has taken over. It gets nothing more; ",
        "name the other one with --server"));
  }
  if (id == last_.id && generation == last_.generation) return absl::OkStatus();
  RIGCAL_RETURN_IF_ERROR(WriteDurableFile(file_, absl::StrCat(id, " ", generation, "\n")));
  last_ = {.id = id, .generation = generation};
  return absl::OkStatus();
}

}  // namespace rigcal::agent

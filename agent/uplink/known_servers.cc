// SPDX-License-Identifier: Apache-2.0
#include "agent/uplink/known_servers.h"

#include <fstream>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "common/file/durable_file.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {

absl::StatusOr<KnownServers> KnownServers::Open(std::filesystem::path file) {
  KnownServers known(std::move(file));
  std::error_code error;
  if (!std::filesystem::exists(known.file_, error)) return known;
  std::ifstream stream(known.file_);
  std::string proof;
  if (stream >> known.last_.id >> known.last_.generation &&
      (!(stream >> proof) || absl::Base64Unescape(proof, &known.last_.proof))) {
    return known;
  }
  return absl::DataLossError(
      absl::StrCat(known.file_.string(),
                   " is damaged: it must hold a server's id and its generation; remove it if no "
                   "standby has ever taken over from this agent's server"));
}

absl::Status KnownServers::Meet(const std::string& address, const Server& server) {
  if (server.generation == 0) return absl::OkStatus();
  if (server.id == last_.id && server.generation < last_.generation) {
    return absl::FailedPreconditionError(absl::StrCat(
        "server ", address, " has generation ", server.generation, ", and this agent has spoken ",
        "with generation ", last_.generation, " of it: a standby has taken over. It gets nothing ",
        "more; name the other one with --server"));
  }
  if (server.id == last_.id && server.generation == last_.generation &&
      (server.proof.empty() || !last_.proof.empty())) {
    return absl::OkStatus();
  }
  RIGCAL_RETURN_IF_ERROR(
      WriteDurableFile(file_, absl::StrCat(server.id, " ", server.generation, " ",
                                           absl::Base64Escape(server.proof), "\n")));
  last_ = server;
  return absl::OkStatus();
}

}  // namespace rigcal::agent

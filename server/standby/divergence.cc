// SPDX-License-Identifier: Apache-2.0
#include "server/standby/divergence.h"

#include <algorithm>
#include <map>
#include <set>

#include "absl/strings/str_cat.h"

namespace rigcal::server {
namespace {

constexpr size_t kNamed = 8;

std::string RowsText(uint32_t first, uint32_t last) {
  return absl::StrCat("observations ", first, " to ", last, " (", last - first + 1, ")");
}

}  // namespace

std::vector<std::string> OwnExtras(const ReplicaListing& own, const ReplicaListing& primary) {
  std::vector<std::string> extras;
  std::map<std::string, const ReplicaRecord*> sessions;
  for (const ReplicaRecord& session : primary.sessions) sessions[session.id] = &session;
  const std::set<std::string> deleted(primary.deleted_sessions.begin(),
                                      primary.deleted_sessions.end());
  for (const ReplicaRecord& session : own.sessions) {
    const auto found = sessions.find(session.id);
    if (found == sessions.end()) {
      if (deleted.contains(session.id)) continue;
      uint64_t rows = 0;
      for (const StreamProgress& stream : session.streams) rows += stream.durable_seq;
      extras.push_back(absl::StrCat("session ", session.id, " with ", rows, " observations"));
      continue;
    }
    std::map<StreamKey, uint32_t> durable;
    for (const StreamProgress& stream : found->second->streams) {
      durable[stream.stream] = stream.durable_seq;
    }
    for (const StreamProgress& stream : session.streams) {
      const uint32_t there = durable[stream.stream];
      if (stream.durable_seq <= there) continue;
      extras.push_back(absl::StrCat("session ", session.id, ", camera ", stream.stream.camera, ": ",
                                    RowsText(there + 1, stream.durable_seq)));
    }
  }
  std::set<std::string> calibrations;
  for (const ReplicaRecord& record : primary.calibrations) calibrations.insert(record.id);
  for (const ReplicaRecord& record : own.calibrations) {
    if (!calibrations.contains(record.id)) extras.push_back("calibration " + record.id);
  }
  return extras;
}

absl::Status RefuseExtras(const std::vector<std::string>& extras, const std::string& primary,
                          const std::string& data_dir) {
  if (extras.empty()) return absl::OkStatus();
  std::string list;
  for (size_t i = 0; i < std::min(extras.size(), kNamed); ++i) {
    absl::StrAppend(&list, "\n  ", extras[i]);
  }
  if (extras.size() > kNamed) absl::StrAppend(&list, "\n  and ", extras.size() - kNamed, " more");
  return absl::FailedPreconditionError(absl::StrCat(
      data_dir, " has what ", primary, " does not have, and following it would delete that:", list,
      "\nTo keep it, move the folder aside and start the standby with a new one; a server without "
      "--follow on a copy of the folder whose standby.json is removed shows and exports it. "
      "Nothing "
      "has been changed"));
}

}  // namespace rigcal::server

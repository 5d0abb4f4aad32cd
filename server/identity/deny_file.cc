// SPDX-License-Identifier: Apache-2.0
#include "server/identity/deny_file.h"

#include <map>

#include "absl/strings/str_cat.h"
#include "common/identity/durable_file.h"
#include "common/status/status_macros.h"
#include "server/identity/json_fields.h"

namespace rigcal::server {
namespace {

struct DenyEntry {
  std::set<std::string> serials;
  std::string time;
};
using DenyEntries = std::map<std::string, DenyEntry>;  // by URI

bool ReadDenyEntry(const IdentityJson& json, DenyEntries* entries) {
  JsonFields fields(json);
  const std::string uri = fields.Text("uri");
  if (!fields.good() || !json.contains("serials") || !json["serials"].is_array()) return false;
  DenyEntry& entry = (*entries)[uri];
  if (fields.Has("time")) entry.time = fields.Text("time");
  for (const IdentityJson& serial : json["serials"]) {
    if (!serial.is_string()) return false;
    entry.serials.insert(serial.get<std::string>());
  }
  return fields.good();
}

absl::StatusOr<DenyEntries> ReadDenyEntries(const std::filesystem::path& file) {
  DenyEntries entries;
  const absl::StatusOr<std::string> text = ReadSmallFile(file);
  if (absl::IsNotFound(text.status())) return entries;
  if (!text.ok()) return text.status();
  const IdentityJson json = IdentityJson::parse(*text, nullptr, /*allow_exceptions=*/false);
  bool good = json.is_object() && json.contains("denied") && json["denied"].is_array();
  if (good) {
    for (const IdentityJson& entry : json["denied"]) good = good && ReadDenyEntry(entry, &entries);
  }
  if (good) return entries;
  return absl::DataLossError(
      absl::StrCat(file.string(), " is damaged, so nobody is let in; restore it from a backup"));
}

}  // namespace

absl::StatusOr<bool> IsDenied(const std::filesystem::path& file, std::string_view uri,
                              std::string_view serial) {
  RIGCAL_ASSIGN_OR_RETURN(const DenyEntries entries, ReadDenyEntries(file));
  const auto entry = entries.find(std::string(uri));
  return entry != entries.end() &&
         (entry->second.serials.empty() || entry->second.serials.contains(std::string(serial)));
}

absl::Status DenyCertificates(const std::filesystem::path& file, const std::string& uri,
                              const std::set<std::string>& serials, absl::Time now) {
  RIGCAL_ASSIGN_OR_RETURN(DenyEntries entries, ReadDenyEntries(file));
  const bool all = entries.contains(uri) && entries[uri].serials.empty();
  if (serials.empty() || all) return absl::OkStatus();
  entries[uri].serials.insert(serials.begin(), serials.end());
  entries[uri].time = JsonTime(now);
  IdentityJson list = IdentityJson::array();
  for (const auto& [name, entry] : entries) {
    list.push_back({{"uri", name}, {"serials", entry.serials}, {"time", entry.time}});
  }
  return WriteDurableFile(file, IdentityJson{{"denied", list}}.dump(1) + "\n");
}

}  // namespace rigcal::server

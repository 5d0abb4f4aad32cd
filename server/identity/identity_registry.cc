// SPDX-License-Identifier: Apache-2.0
#include "server/identity/identity_registry.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "common/file/durable_file.h"
#include "common/status/status_macros.h"
#include "server/identity/certificate_authority.h"
#include "server/identity/json_fields.h"
#include "server/identity/watched_file.h"

namespace rigcal::server {
namespace {

IdentityJson ToJson(const IdentityRecord& record) {
  IdentityJson serials = IdentityJson::object();
  for (const auto& [serial, expires] : record.serials) serials[serial] = JsonTime(expires);
  IdentityJson json = {{"uri", record.uri},
                       {"name", record.name},
                       {"role", RoleName(record.role)},
                       {"joined", JsonTime(record.joined)},
                       {"expires", JsonTime(record.expires)},
                       {"serials", serials}};
  if (record.revoked) json["revoked"] = JsonTime(*record.revoked);
  return json;
}

std::optional<IdentityRecord> RecordFromJson(const IdentityJson& json) {
  JsonFields fields(json);
  IdentityRecord record{.uri = fields.Text("uri"),
                        .name = fields.Text("name"),
                        .joined = fields.Time("joined"),
                        .expires = fields.Time("expires")};
  if (fields.Has("revoked")) record.revoked = fields.Time("revoked");
  const std::optional<Role> role = RoleFromName(fields.Text("role"));
  if (!fields.good() || !role || !json.contains("serials")) return std::nullopt;
  record.role = *role;
  JsonFields serials(json["serials"]);
  for (const auto& item : json["serials"].items()) {
    record.serials[item.key()] = serials.Time(item.key().c_str());
  }
  if (!serials.good()) return std::nullopt;
  return record;
}

}  // namespace

absl::StatusOr<IdentityRegistry> IdentityRegistry::Open(std::filesystem::path file) {
  IdentityRegistry registry(std::move(file));
  const absl::StatusOr<std::string> text = ReadWholeFile(registry.file_, kMaxCertificateListBytes);
  if (absl::IsNotFound(text.status())) return registry;
  if (!text.ok()) return text.status();
  RIGCAL_ASSIGN_OR_RETURN(registry.records_, Parse(*text, registry.file_));
  return registry;
}

absl::StatusOr<IdentityRegistry::Records> IdentityRegistry::Parse(
    const std::string& text, const std::filesystem::path& file) {
  Records records;
  const auto json = ParseJson<IdentityJson>(text);
  bool good = json.is_object() && json.contains("identities") && json["identities"].is_array();
  if (good) {
    for (const IdentityJson& entry : json["identities"]) {
      std::optional<IdentityRecord> record = RecordFromJson(entry);
      good = good && record.has_value();
      if (record) records[record->uri] = *std::move(record);
    }
  }
  if (good) return records;
  return absl::DataLossError(
      absl::StrCat(file.string(),
                   " is damaged, so nobody is let in; restore it from a backup. Without it rigcal "
                   "does not know the certificates that it has given out"));
}

std::vector<IdentityRecord> IdentityRegistry::List() const {
  std::vector<IdentityRecord> list;
  for (const auto& [uri, record] : records_) list.push_back(record);
  return list;
}

const IdentityRecord* IdentityRegistry::Find(std::string_view uri) const {
  const auto record = records_.find(uri);
  return record == records_.end() ? nullptr : &record->second;
}

absl::Status IdentityRegistry::Record(const Certificate& certificate, bool joins, absl::Time now) {
  Records records = records_;
  for (auto& [uri, record] : records) {
    std::erase_if(record.serials,
                  [&](const auto& serial) { return serial.second + kRenewalGrace < now; });
  }
  std::erase_if(records, [](const auto& entry) { return entry.second.serials.empty(); });
  IdentityRecord& record = records[certificate.uri];
  // The certificates of who had the name before are denied by now.
  if (joins || record.uri.empty()) record = {.uri = certificate.uri, .joined = now};
  record.name = certificate.name;
  record.role = certificate.role.value_or(Role::kViewer);
  record.expires = certificate.not_after;
  record.serials[certificate.serial] = certificate.not_after;
  return Save(std::move(records));
}

absl::Status IdentityRegistry::MarkRevoked(std::string_view uri, absl::Time now) {
  Records records = records_;
  const auto record = records.find(uri);
  if (record == records.end()) return absl::NotFoundError("nobody of that name has joined");
  record->second.revoked = now;
  return Save(std::move(records));
}

absl::StatusOr<IdentityRegistry::Since> IdentityRegistry::TakeChangesOf(
    const IdentityRegistry& replaced, absl::Time now) {
  Since since;
  Records records = records_;
  for (const auto& [uri, newer] : replaced.records_) {
    const auto found = records.find(uri);
    IdentityRecord* const record = found == records.end() ? nullptr : &found->second;
    const bool is_same = record != nullptr && record->joined == newer.joined;
    if (is_same) {
      record->serials.insert(newer.serials.begin(), newer.serials.end());
      record->expires = std::max(record->expires, newer.expires);
      if (!record->revoked) record->revoked = newer.revoked;
      continue;
    }
    // The backup may be the newer one: another was restored before.
    if (record != nullptr && record->joined > newer.joined) continue;
    if (!newer.revoked) since.joined.push_back(uri);
    if (record == nullptr) continue;
    since.replaced.push_back(*record);
    if (!record->revoked) record->revoked = now;
  }
  RIGCAL_RETURN_IF_ERROR(Save(std::move(records)));
  return since;
}

absl::Status IdentityRegistry::Save(Records records) {
  IdentityJson list = IdentityJson::array();
  for (const auto& [uri, record] : records) list.push_back(ToJson(record));
  RIGCAL_RETURN_IF_ERROR(
      WriteDurableFile(file_, IdentityJson{{"identities", list}}.dump(1) + "\n"));
  records_ = std::move(records);
  return absl::OkStatus();
}

}  // namespace rigcal::server

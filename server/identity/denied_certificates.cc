// SPDX-License-Identifier: Apache-2.0
#include "server/identity/denied_certificates.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <iterator>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "common/file/durable_file.h"
#include "common/status/status_macros.h"
#include "server/identity/json_fields.h"

namespace rigcal::server {
namespace {

using Serials = std::set<std::string, std::less<>>;

// As Certificate::serial.
std::string NormalSerial(std::string serial) {
  absl::AsciiStrToLower(&serial);
  std::erase(serial, ':');
  const size_t first = serial.find_first_not_of('0');
  return first == std::string::npos ? "0" : serial.substr(first);
}

bool ReadSerials(const IdentityJson& list, Serials* serials) {
  if (!list.is_array()) return false;
  for (const IdentityJson& serial : list) {
    if (!serial.is_string()) return false;
    serials->insert(NormalSerial(serial.get<std::string>()));
  }
  return true;
}

}  // namespace

DeniedCertificates::DeniedCertificates(std::filesystem::path file)
    : file_(file, [file](const std::string& text) { return Parse(file, text); }) {}

absl::StatusOr<DeniedCertificates::Entries> DeniedCertificates::Parse(
    const std::filesystem::path& file, const std::string& text) {
  const absl::Status damaged = absl::DataLossError(
      absl::StrCat(file.string(), " is damaged, so nobody is let in; restore it from a backup"));
  const auto json = ParseJson<IdentityJson>(text);
  if (!json.is_object() || !json.contains("denied") || !json["denied"].is_array()) return damaged;
  Entries entries;
  for (const IdentityJson& item : json["denied"]) {
    JsonFields fields(item);
    Entry& entry = entries[fields.Text("uri")];
    if (fields.Has("time")) entry.time = fields.Text("time");
    if (!fields.good() || !item.contains("serials")) return damaged;
    if (!ReadSerials(item["serials"], &entry.serials)) return damaged;
    if (item.contains("all_but")) {
      if (!ReadSerials(item["all_but"], &entry.all_but)) return damaged;
      entry.all = true;
    } else if (item["serials"].empty()) {
      entry.for_good = true;
    }
  }
  for (auto& [uri, entry] : entries) {
    if (!entry.for_good) continue;
    entry.all = false;
    entry.serials.clear();
    entry.all_but.clear();
  }
  return entries;
}

absl::Status DeniedCertificates::Refresh() {
  const absl::Status status = file_.Refresh();
  if (!status.ok() && status != logged_) {
    spdlog::error("every certificate is refused: {}", std::string(status.message()));
  }
  return logged_ = status;
}

absl::StatusOr<bool> DeniedCertificates::Denies(std::string_view uri, std::string_view serial) {
  std::lock_guard lock(mutex_);
  RIGCAL_RETURN_IF_ERROR(Refresh());
  const auto found = file_.content().find(uri);
  if (found == file_.content().end()) return false;
  const Entry& entry = found->second;
  return entry.for_good || entry.serials.contains(serial) ||
         (entry.all && !entry.all_but.contains(serial));
}

absl::Status DeniedCertificates::Deny(const std::string& uri, const std::set<std::string>& serials,
                                      absl::Time now) {
  std::lock_guard lock(mutex_);
  RIGCAL_RETURN_IF_ERROR(Refresh());
  Entries entries = file_.content();
  Entry& entry = entries[uri];
  if (entry.for_good) return absl::OkStatus();
  entry.serials.insert(serials.begin(), serials.end());
  entry.serials.insert(entry.all_but.begin(), entry.all_but.end());
  entry.all_but.clear();
  entry.all = true;
  entry.time = JsonTime(now);
  return Save(entries);
}

absl::Status DeniedCertificates::Accept(const std::string& uri, const std::string& serial) {
  std::lock_guard lock(mutex_);
  RIGCAL_RETURN_IF_ERROR(Refresh());
  Entries entries = file_.content();
  const auto entry = entries.find(uri);
  if (entry == entries.end() || !entry->second.all) return absl::OkStatus();
  if (!entry->second.all_but.insert(serial).second) return absl::OkStatus();
  return Save(entries);
}

absl::Status DeniedCertificates::TakeAllOf(DeniedCertificates& other) {
  Entries more;
  {
    std::lock_guard lock(other.mutex_);
    RIGCAL_RETURN_IF_ERROR(other.Refresh());
    more = other.file_.content();
  }
  std::lock_guard lock(mutex_);
  RIGCAL_RETURN_IF_ERROR(Refresh());
  Entries entries = file_.content();
  for (auto& [uri, from] : more) {
    Entry& into = entries[uri];
    if (from.all && into.all) {
      Serials both;
      std::ranges::set_intersection(into.all_but, from.all_but, std::inserter(both, both.end()));
      into.all_but = std::move(both);
    } else if (from.all) {
      into.all_but = from.all_but;
    }
    into.all |= from.all;
    into.for_good |= from.for_good;
    into.serials.insert(from.serials.begin(), from.serials.end());
    into.time = std::max(into.time, from.time);
  }
  return more.empty() ? absl::OkStatus() : Save(entries);
}

absl::Status DeniedCertificates::Save(const Entries& entries) {
  IdentityJson list = IdentityJson::array();
  for (const auto& [uri, entry] : entries) {
    IdentityJson item = {{"uri", uri}, {"serials", IdentityJson::array()}};
    if (!entry.for_good) item["serials"] = entry.serials;
    if (entry.all && !entry.for_good) item["all_but"] = entry.all_but;
    item["time"] = entry.time;
    list.push_back(std::move(item));
  }
  return WriteDurableFile(file_.path(), IdentityJson{{"denied", list}}.dump(1) + "\n");
}

}  // namespace rigcal::server

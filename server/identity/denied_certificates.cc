// SPDX-License-Identifier: Apache-2.0
#include "server/identity/denied_certificates.h"

#include <spdlog/spdlog.h>

#include <cerrno>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "common/file/durable_file.h"
#include "common/status/status_macros.h"
#include "server/identity/json_fields.h"

namespace rigcal::server {
namespace {

// As Certificate::serial.
std::string NormalSerial(std::string serial) {
  absl::AsciiStrToLower(&serial);
  std::erase(serial, ':');
  const size_t first = serial.find_first_not_of('0');
  return first == std::string::npos ? "0" : serial.substr(first);
}

bool IsSameFile(const struct stat& a, const struct stat& b) {
  return a.st_ino == b.st_ino && a.st_size == b.st_size && a.st_mtim.tv_sec == b.st_mtim.tv_sec &&
         a.st_mtim.tv_nsec == b.st_mtim.tv_nsec;
}

}  // namespace

absl::StatusOr<DeniedCertificates::Entries> DeniedCertificates::Read() const {
  const absl::StatusOr<std::string> text = ReadSmallFile(file_);
  if (absl::IsNotFound(text.status())) return Entries();
  if (!text.ok()) return text.status();
  const absl::Status damaged = absl::DataLossError(
      absl::StrCat(file_.string(), " is damaged, so nobody is let in; restore it from a backup"));
  const auto json = ParseJson<IdentityJson>(*text);
  if (!json.is_object() || !json.contains("denied") || !json["denied"].is_array()) return damaged;
  Entries entries;
  for (const IdentityJson& item : json["denied"]) {
    JsonFields fields(item);
    Entry& entry = entries[fields.Text("uri")];
    if (fields.Has("time")) entry.time = fields.Text("time");
    if (!fields.good() || !item.contains("serials") || !item["serials"].is_array()) return damaged;
    if (item["serials"].empty()) entry.all = true;
    for (const IdentityJson& serial : item["serials"]) {
      if (!serial.is_string()) return damaged;
      entry.serials.insert(NormalSerial(serial.get<std::string>()));
    }
  }
  for (auto& [uri, entry] : entries) {
    if (entry.all) entry.serials.clear();
  }
  return entries;
}

absl::Status DeniedCertificates::ReadAgainIfChanged() {
  struct stat now {};
  const bool exists = stat(file_.c_str(), &now) == 0;
  if (!exists && errno == ENOENT) {
    seen_ = {};
    entries_.clear();
    return state_ = absl::OkStatus();
  }
  if (exists && IsSameFile(now, seen_)) return state_;
  absl::StatusOr<Entries> read = Read();
  seen_ = {};  // what cannot be read, for another reason than damage, is tried again
  if (read.ok() || absl::IsDataLoss(read.status())) seen_ = now;
  if (!read.ok() && read.status() != state_) {
    spdlog::error("every certificate is refused: {}", std::string(read.status().message()));
  }
  state_ = read.status();
  entries_ = read.ok() ? *std::move(read) : Entries();
  return state_;
}

absl::StatusOr<bool> DeniedCertificates::Denies(std::string_view uri, std::string_view serial) {
  std::lock_guard lock(mutex_);
  RIGCAL_RETURN_IF_ERROR(ReadAgainIfChanged());
  const auto entry = entries_.find(uri);
  return entry != entries_.end() && (entry->second.all || entry->second.serials.contains(serial));
}

absl::Status DeniedCertificates::Deny(const std::string& uri, const std::set<std::string>& serials,
                                      absl::Time now) {
  std::lock_guard lock(mutex_);
  RIGCAL_RETURN_IF_ERROR(ReadAgainIfChanged());
  Entries entries = entries_;
  if (serials.empty() || entries[uri].all) return absl::OkStatus();
  entries[uri].serials.insert(serials.begin(), serials.end());
  entries[uri].time = JsonTime(now);
  IdentityJson list = IdentityJson::array();
  for (const auto& [name, entry] : entries) {
    list.push_back({{"uri", name}, {"serials", entry.serials}, {"time", entry.time}});
  }
  return WriteDurableFile(file_, IdentityJson{{"denied", list}}.dump(1) + "\n");
}

}  // namespace rigcal::server

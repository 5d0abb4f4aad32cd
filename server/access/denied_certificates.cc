// SPDX-License-Identifier: Apache-2.0
#include "server/access/denied_certificates.h"

#include <spdlog/spdlog.h>

#include <cerrno>
#include <fstream>
#include <nlohmann/json.hpp>

#include "absl/strings/ascii.h"

namespace rigcal::server {
namespace {

// As Peer::serial.
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

bool DeniedCertificates::Denies(const Peer& peer) {
  if (!peer.has_certificate) return false;
  std::lock_guard lock(mutex_);
  ReadAgainIfChanged();
  if (damaged_) return true;
  const auto entry = serials_by_uri_.find(peer.uri);
  return entry != serials_by_uri_.end() &&
         (entry->second.empty() || entry->second.contains(peer.serial));
}

void DeniedCertificates::ReadAgainIfChanged() {
  struct stat now {};
  if (stat(file_.c_str(), &now) != 0) {
    if (errno != ENOENT && !damaged_) {
      spdlog::error("{} cannot be read: every certificate is refused until it can", file_.string());
    }
    damaged_ = errno != ENOENT;
    serials_by_uri_.clear();
    read_once_ = false;
    return;
  }
  if (read_once_ && IsSameFile(now, seen_)) return;
  read_once_ = true;
  seen_ = now;
  std::map<std::string, std::set<std::string>> read;
  try {
    std::ifstream stream(file_);
    const nlohmann::json list = nlohmann::json::parse(stream);
    for (const nlohmann::json& entry : list.at("denied")) {
      std::set<std::string>& serials = read[entry.at("uri").get<std::string>()];
      for (const nlohmann::json& serial : entry.at("serials")) {
        serials.insert(NormalSerial(serial.get<std::string>()));
      }
    }
    damaged_ = false;
  } catch (const std::exception& error) {
    spdlog::error("{} is damaged, and every certificate is refused until it is repaired: {}",
                  file_.string(), error.what());
    damaged_ = true;
  }
  serials_by_uri_ = std::move(read);
}

}  // namespace rigcal::server

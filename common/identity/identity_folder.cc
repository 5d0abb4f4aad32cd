// SPDX-License-Identifier: Apache-2.0
#include "common/identity/identity_folder.h"

#include <fcntl.h>
#include <stdio.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "common/file/durable_file.h"
#include "common/file/private_folder.h"
#include "common/identity/join_string.h"
#include "common/identity/private_key.h"
#include "common/status/status_macros.h"
#include "common/text/nesting.h"

namespace rigcal {
namespace {

using Json = nlohmann::ordered_json;

constexpr char kCaFile[] = "ca.crt";
constexpr char kServersFile[] = "servers.json";
constexpr char kAskedFile[] = "asked";
constexpr size_t kMaxServers = 256;  // of each kind: a server names every address of its PC

absl::Status ReadAddresses(const Json& json, const char* key, std::vector<std::string>* addresses) {
  const auto list = json.find(key);
  if (list == json.end() || !list->is_array()) {
    return absl::InvalidArgumentError(absl::StrCat("\"", key, "\" is not a list"));
  }
  addresses->clear();
  for (const Json& address : *list) {
    if (!address.is_string()) {
      return absl::InvalidArgumentError(absl::StrCat("\"", key, "\" holds what is no text"));
    }
    const std::string text = address.get<std::string>();
    std::string host;
    uint16_t port = 0;
    if (!SplitHostPort(text, &host, &port) || !IsHostText(host) || port == 0 ||
        addresses->size() >= kMaxServers) {
      return absl::InvalidArgumentError(
          absl::StrCat("\"", key, "\" holds what is not HOST:PORT, or too much"));
    }
    addresses->push_back(text);
  }
  return absl::OkStatus();
}

// $VARIABLE, else $HOME/BELOW; empty: neither is set. The XDG specification says to ignore a
// relative path there.
std::filesystem::path BaseFolder(const char* variable, const char* below) {
  const char* const folder = std::getenv(variable);
  if (folder != nullptr && folder[0] == '/') return folder;
  const char* const home = std::getenv("HOME");
  if (home != nullptr && home[0] == '/') return std::filesystem::path(home) / below;
  return {};
}

// Exchanges both in one step where the file system can; false: it cannot.
bool Exchange(const std::filesystem::path& a, const std::filesystem::path& b) {
  return renameat2(AT_FDCWD, a.c_str(), AT_FDCWD, b.c_str(), RENAME_EXCHANGE) == 0;
}

}  // namespace

std::string FormatServers(const PeerIdentity& identity) {
  return Json{{"grpc", identity.grpc}, {"https", identity.https}}.dump(2) + "\n";
}

absl::Status ParseServers(std::string_view text, PeerIdentity* identity) {
  const Json json = ParseJson<Json>(text);
  if (!json.is_object()) return absl::InvalidArgumentError("not a JSON object");
  RIGCAL_RETURN_IF_ERROR(ReadAddresses(json, "grpc", &identity->grpc));
  return ReadAddresses(json, "https", &identity->https);
}

absl::Status CheckIdentity(const PeerIdentity& identity) {
  const auto parse = [](const char* what, const std::string& pem) -> absl::StatusOr<Certificate> {
    auto parsed = ParseOnlyCertificate(pem);
    if (parsed.ok()) return parsed;
    return absl::FailedPreconditionError(
        absl::StrCat(what, " ", std::string(parsed.status().message())));
  };
  RIGCAL_ASSIGN_OR_RETURN(const Certificate ca, parse("the CA's certificate", identity.ca_pem));
  RIGCAL_ASSIGN_OR_RETURN(const Certificate certificate,
                          parse("the certificate", identity.certificate_pem));
  RIGCAL_RETURN_IF_ERROR(CheckIssuedBy(certificate, ca.pem, CertificateUse::kClient));
  return CheckKeyOf(identity.certificate_pem, identity.key_pem, "certificate and private key");
}

bool IdentityFolder::Exists() const {
  std::error_code error;
  return !path_.empty() && std::filesystem::exists(path_ / (stem_ + ".crt"), error);
}

absl::StatusOr<PeerIdentity> IdentityFolder::Load() const {
  if (!Exists()) {
    return absl::NotFoundError(absl::StrCat("there is no identity in ", path_.string()));
  }
  const auto damaged = [&](const absl::Status& status) {
    return absl::FailedPreconditionError(absl::StrCat(
        "the identity in ", path_.string(), " cannot be used: ", std::string(status.message()),
        "; join again with a new join string: ",
        stem_ == "agent" ? "rigcal-agent join STRING --force" : "rigcal login STRING"));
  };
  PeerIdentity identity;
  for (const auto& [file, text] : {std::pair{std::string(kCaFile), &identity.ca_pem},
                                   {stem_ + ".crt", &identity.certificate_pem},
                                   {stem_ + ".key", &identity.key_pem}}) {
    auto read = ReadSmallFile(path_ / file);
    if (!read.ok()) return damaged(read.status());
    *text = *std::move(read);
  }
  const auto servers = ReadSmallFile(path_ / kServersFile);
  if (!servers.ok()) return damaged(servers.status());
  if (const absl::Status status = ParseServers(*servers, &identity); !status.ok()) {
    return damaged(absl::Status(status.code(),
                                absl::StrCat(kServersFile, ": ", std::string(status.message()))));
  }
  for (const auto& [file, text] : {std::pair{std::string(kCaFile), &identity.ca_pem},
                                   {stem_ + ".crt", &identity.certificate_pem}}) {
    const absl::StatusOr<Certificate> only = ParseCertificateFile(*text);
    if (!only.ok()) {
      return damaged(absl::FailedPreconditionError(
          absl::StrCat(file, " ", std::string(only.status().message()),
                       file == kCaFile ? ": whoever has the key of another one would be trusted as "
                                         "the server; he may have answered when this PC joined"
                                       : "")));
    }
    *text = only->pem;
  }
  const absl::Status pair = CheckKeyOf(identity.certificate_pem, identity.key_pem,
                                       absl::StrCat(stem_, ".key and ", stem_, ".crt"));
  if (!pair.ok()) return damaged(pair);
  if (const absl::Status status = CheckIdentity(identity); !status.ok()) return damaged(status);
  return identity;
}

absl::Status IdentityFolder::WriteFiles(const PeerIdentity& identity,
                                        const std::filesystem::path& folder) const {
  RIGCAL_RETURN_IF_ERROR(MakePrivateFolder(folder));
  RIGCAL_RETURN_IF_ERROR(WriteDurableFile(folder / kCaFile, identity.ca_pem));
  RIGCAL_RETURN_IF_ERROR(WriteDurableFile(folder / (stem_ + ".key"), identity.key_pem));
  RIGCAL_RETURN_IF_ERROR(WriteDurableFile(folder / kServersFile, FormatServers(identity)));
  return WriteDurableFile(folder / (stem_ + ".crt"), identity.certificate_pem);
}

absl::Status IdentityFolder::Replace(const PeerIdentity& identity) const {
  RIGCAL_RETURN_IF_ERROR(CheckIdentity(identity));
  const std::filesystem::path fresh = path_.string() + ".new";
  std::error_code error;
  std::filesystem::remove_all(fresh, error);
  RIGCAL_RETURN_IF_ERROR(WriteFiles(identity, fresh));
  std::filesystem::create_directories(path_.parent_path(), error);
  if (!std::filesystem::exists(path_, error)) {
    if (rename(fresh.c_str(), path_.c_str()) == 0) return absl::OkStatus();
    return absl::ErrnoToStatus(errno, absl::StrCat("cannot make ", path_.string()));
  }
  // Old files never meet new ones: the folders change places.
  const bool replaced = Exchange(fresh, path_);
  const absl::Status status =
      replaced ? absl::OkStatus() : WriteFiles(identity, path_);  // a file system without exchange
  std::filesystem::remove_all(fresh, error);
  return status;
}

absl::Status IdentityFolder::Renew(const PeerIdentity& identity) const {
  RIGCAL_RETURN_IF_ERROR(CheckIdentity(identity));
  RIGCAL_RETURN_IF_ERROR(WriteDurableFile(path_ / kServersFile, FormatServers(identity)));
  return WriteDurableFile(path_ / (stem_ + ".crt"), identity.certificate_pem);
}

std::optional<absl::Time> IdentityFolder::Asked() const {
  struct stat status {};
  if (path_.empty() || stat((path_ / kAskedFile).c_str(), &status) != 0) return std::nullopt;
  return absl::TimeFromTimespec(status.st_mtim);
}

void IdentityFolder::NoteAsked() const {
  // Where it cannot be written, the server is asked again.
  const int fd =
      open((path_ / kAskedFile).c_str(), O_WRONLY | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (fd < 0) return;
  futimens(fd, nullptr);
  close(fd);
}

std::vector<IdentityFolder> DefaultAgentIdentities() {
  const std::filesystem::path base = BaseFolder("XDG_STATE_HOME", ".local/state");
  std::vector<IdentityFolder> folders;
  if (base.empty()) return folders;
  std::error_code error;
  std::filesystem::directory_iterator entry(base / "rigcal" / "agent", error);
  while (!error && entry != std::filesystem::directory_iterator()) {
    const IdentityFolder folder = IdentityFolder::OfAgent(entry->path());
    if (folder.Exists()) folders.push_back(folder);
    entry.increment(error);
  }
  std::ranges::sort(folders, {}, &IdentityFolder::path);
  return folders;
}

std::filesystem::path UserConfigFolder() {
  const std::filesystem::path base = BaseFolder("XDG_CONFIG_HOME", ".config");
  return base.empty() ? base : base / "rigcal";
}

}  // namespace rigcal

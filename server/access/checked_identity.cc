// SPDX-License-Identifier: Apache-2.0
#include "server/access/checked_identity.h"

#include <fcntl.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <iterator>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"

namespace rigcal::server {
namespace {

namespace fs = std::filesystem;

constexpr std::array<const char*, 3> kFiles = {"ca.crt", "server.crt", "server.key"};
constexpr int64_t kWarnBeforeEndS = 14 * 86'400;

absl::StatusOr<std::string> ReadIdentityFile(const fs::path& path) {
  std::ifstream stream(path, std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(stream), {}};
  if (!stream.is_open() || text.empty()) {
    return absl::FailedPreconditionError(absl::StrCat("cannot read ", path.string()));
  }
  return text;
}

absl::Status WritePrivateFile(const fs::path& path, const std::string& text) {
  const int descriptor = open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  const bool written = descriptor >= 0 && write(descriptor, text.data(), text.size()) ==
                                              static_cast<ssize_t>(text.size());
  const int error = errno;
  if (descriptor >= 0) close(descriptor);
  if (written) return absl::OkStatus();
  return absl::ErrnoToStatus(error, absl::StrCat("cannot write ", path.string()));
}

}  // namespace

absl::StatusOr<std::unique_ptr<CheckedIdentity>> CheckedIdentity::Load(
    fs::path folder, std::function<int64_t()> utc_now_s) {
  std::unique_ptr<CheckedIdentity> identity(
      new CheckedIdentity(std::move(folder), std::move(utc_now_s)));
  std::lock_guard lock(identity->mutex_);
  identity->version_ = identity->Version();
  RIGCAL_RETURN_IF_ERROR(identity->Take());
  identity->WarnOfEnd();
  return identity;
}

int64_t CheckedIdentity::NowUtcS() const {
  if (utc_now_s_) return utc_now_s_();
  return std::chrono::duration_cast<std::chrono::seconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

std::shared_ptr<const TrustedCa> CheckedIdentity::ca() const {
  std::lock_guard lock(mutex_);
  return ca_;
}

std::string CheckedIdentity::Version() const {
  std::string version;
  for (const char* name : kFiles) {
    struct stat status {};
    if (stat((folder_ / name).c_str(), &status) != 0) {
      absl::StrAppend(&version, "-;");
      continue;
    }
    absl::StrAppend(&version, status.st_ino, " ", status.st_size, " ", status.st_mtim.tv_sec, " ",
                    status.st_mtim.tv_nsec, ";");
  }
  return version;
}

absl::Status CheckedIdentity::Take() {
  std::array<std::string, 3> texts;
  for (size_t i = 0; i < kFiles.size(); ++i) {
    RIGCAL_ASSIGN_OR_RETURN(texts.at(i), ReadIdentityFile(folder_ / kFiles.at(i)));
  }
  const auto in_file = [&](const char* name, const absl::Status& status) {
    return absl::FailedPreconditionError(
        absl::StrCat((folder_ / name).string(), ": ", status.message()));
  };
  absl::StatusOr<TrustedCa> ca = TrustedCa::Parse(texts[0]);
  if (!ca.ok()) return in_file(kFiles[0], ca.status());
  if (const absl::Status status = ca->CheckServerCertificate(texts[1], texts[2], NowUtcS());
      !status.ok()) {
    return in_file(kFiles[1], status);
  }
  RIGCAL_ASSIGN_OR_RETURN(end_utc_s_, CertificateEndUtcS(texts[1]));
  RIGCAL_RETURN_IF_ERROR(Publish(texts));
  ca_ = std::make_shared<const TrustedCa>(*std::move(ca));
  end_logged_ = false;
  return absl::OkStatus();
}

absl::Status CheckedIdentity::Publish(const std::array<std::string, 3>& texts) {
  const fs::path base = folder_ / ".active";
  std::error_code error;
  if (published_ == 0) fs::remove_all(base, error);  // of an earlier run
  const std::string name = absl::StrCat(++published_);
  const fs::path folder = base / name;
  fs::create_directories(folder, error);
  if (error) {
    return absl::FailedPreconditionError(
        absl::StrCat("cannot make the folder ", folder.string(), ": ", error.message()));
  }
  fs::permissions(base, fs::perms::owner_all, error);
  for (size_t i = 0; i < kFiles.size(); ++i) {
    RIGCAL_RETURN_IF_ERROR(WritePrivateFile(folder / kFiles.at(i), texts.at(i)));
  }
  // One rename switches all three files at once.
  const fs::path link = base / "next";
  fs::remove(link, error);
  fs::create_directory_symlink(name, link, error);
  if (!error) fs::rename(link, base / "current", error);
  if (error) {
    return absl::FailedPreconditionError(
        absl::StrCat("cannot replace ", active().string(), ": ", error.message()));
  }
  if (published_ > 1) fs::remove_all(base / absl::StrCat(published_ - 1), error);
  return absl::OkStatus();
}

void CheckedIdentity::Refresh() {
  std::lock_guard lock(mutex_);
  WarnOfEnd();
  const std::string version = Version();
  if (version == version_) return;
  const absl::Status status = Take();
  if (status.ok()) {
    version_ = version;
    faulty_version_.clear();
    spdlog::info("the server's certificate in {} was replaced", folder_.string());
    return;
  }
  // Once is no fault yet: the files may be in the middle of being replaced.
  if (std::exchange(faulty_version_, version) != version) {
    fault_logged_ = false;
  } else if (!std::exchange(fault_logged_, true)) {
    spdlog::error("the new certificate is not used, the old one stays: {}",
                  std::string(status.message()));
  }
}

void CheckedIdentity::WarnOfEnd() {
  const int64_t left_s = end_utc_s_ - NowUtcS();
  if (left_s > kWarnBeforeEndS || std::exchange(end_logged_, true)) return;
  spdlog::warn("the server's certificate in {} ends in {} days: renew it", folder_.string(),
               left_s / 86'400);
}

}  // namespace rigcal::server

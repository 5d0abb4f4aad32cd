// SPDX-License-Identifier: Apache-2.0
#include "server/access/checked_identity.h"

#include <spdlog/spdlog.h>
#include <sys/stat.h>

#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/file/durable_file.h"
#include "common/status/status_macros.h"

namespace rigcal::server {
namespace {

namespace fs = std::filesystem;

constexpr std::array<const char*, 3> kFiles = {"ca.crt", "server.crt", "server.key"};
constexpr absl::Duration kWarnBeforeEnd = absl::Hours(14 * 24);

}  // namespace

absl::StatusOr<std::unique_ptr<CheckedIdentity>> CheckedIdentity::Load(
    fs::path folder, std::function<absl::Time()> now) {
  std::unique_ptr<CheckedIdentity> identity(new CheckedIdentity(std::move(folder), std::move(now)));
  std::lock_guard lock(identity->mutex_);
  identity->version_ = identity->Version();
  RIGCAL_RETURN_IF_ERROR(identity->Take());
  identity->WarnOfEnd();
  return identity;
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
  const auto in_file = [&](const char* name, const absl::Status& status) {
    return absl::FailedPreconditionError(
        absl::StrCat((folder_ / name).string(), ": ", status.message()));
  };
  std::array<std::string, 3> texts;
  for (size_t i = 0; i < kFiles.size(); ++i) {
    absl::StatusOr<std::string> text = ReadSmallFile(folder_ / kFiles.at(i));
    if (!text.ok()) return absl::FailedPreconditionError(text.status().message());
    texts.at(i) = *std::move(text);
  }
  absl::StatusOr<TrustedCa> ca = TrustedCa::Parse(texts[0]);
  if (!ca.ok()) return in_file(kFiles[0], ca.status());
  const absl::StatusOr<absl::Time> end = ca->CheckServerCertificate(texts[1], texts[2], Now());
  if (!end.ok()) return in_file(kFiles[1], end.status());
  RIGCAL_RETURN_IF_ERROR(Publish(texts));
  end_ = *end;
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
  for (const fs::path& one : {base, folder}) fs::permissions(one, fs::perms::owner_all, error);
  for (size_t i = 0; i < kFiles.size(); ++i) {
    RIGCAL_RETURN_IF_ERROR(WriteDurableFile(folder / kFiles.at(i), texts.at(i)));
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
  const absl::Duration left = end_ - Now();
  if (left > kWarnBeforeEnd || std::exchange(end_logged_, true)) return;
  spdlog::warn("the server's certificate in {} ends in {} days: renew it", folder_.string(),
               left / absl::Hours(24));
}

}  // namespace rigcal::server

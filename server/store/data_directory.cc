// SPDX-License-Identifier: Apache-2.0
#include "server/store/data_directory.h"

#include <fcntl.h>
#include <spdlog/spdlog.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <fstream>
#include <string>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "common/file/durable_file.h"
#include "common/file/file_error.h"
#include "common/file/private_folder.h"
#include "common/status/status_macros.h"

namespace rigcal::server {
namespace {

constexpr char kLockFile[] = "lock";
constexpr char kIdentityFolder[] = "identity";
constexpr const char* kOwnFiles[] = {
    "rigcal.db",   "rigcal.db-wal", "rigcal.db-shm", "rigcal.db-journal", kLockFile, "reserve",
    "audit.jsonl", "audit.jsonl.1", "agents.json",   "monitors.json",     "address"};

// Whoever holds the folder has written its pid into the lock file, unless that was deleted.
absl::Status InUse(const std::filesystem::path& path) {
  std::string owner;
  std::ifstream(path / kLockFile) >> owner;
  return absl::FailedPreconditionError(
      absl::StrCat("data directory ", path.string(), " is in use by another server (pid ",
                   owner.empty() ? "unknown: its file `lock` is gone" : owner,
                   "); stop it or give another --data-dir"));
}

// Others than its owner can enter the folder, which is no shared one such as /tmp.
bool IsOpenToOthers(const std::filesystem::path& folder) {
  struct stat entry = {};
  return stat(folder.c_str(), &entry) == 0 && entry.st_uid == geteuid() &&
         (entry.st_mode & S_ISVTX) == 0 && (entry.st_mode & 077) != 0;
}

}  // namespace

absl::StatusOr<std::unique_ptr<DataDirectory>> DataDirectory::Open(
    const std::filesystem::path& path) {
  const bool was_open = IsOpenToOthers(path);
  RIGCAL_ASSIGN_OR_RETURN(FileDescriptor folder, OpenPrivateFolder(path));
  if (flock(folder.get(), LOCK_EX | LOCK_NB) != 0) {
    if (errno == EWOULDBLOCK) return InUse(path);
    return FileError("lock", path, errno);
  }
  // Others may have put files here while they could.
  for (const char* file : kOwnFiles) RIGCAL_RETURN_IF_ERROR(CheckOwner(path / file));
  RIGCAL_RETURN_IF_ERROR(CheckOwner(path / kIdentityFolder));
  RIGCAL_ASSIGN_OR_RETURN(FileDescriptor lock, OpenPrivateFile(path / kLockFile));
  // Servers of earlier releases lock this file only.
  if (flock(lock.get(), LOCK_EX | LOCK_NB) != 0) {
    if (errno == EWOULDBLOCK) return InUse(path);
    return FileError("lock", path / kLockFile, errno);
  }
  const std::string pid = std::to_string(getpid());
  // Only for messages: a full disk must not keep a server from starting.
  if (ftruncate(lock.get(), 0) == 0) {
    [[maybe_unused]] const ssize_t written = pwrite(lock.get(), pid.data(), pid.size(), 0);
  }
  std::unique_ptr<DataDirectory> directory(
      new DataDirectory(path, std::move(lock), std::move(folder)));
  RemoveUnfinishedFiles(path);
  RemoveUnfinishedFiles(path / kIdentityFolder);
  RIGCAL_RETURN_IF_ERROR(directory->MakePrivate(was_open));
  return directory;
}

absl::Status DataDirectory::MakePrivate(bool changed) const {
  for (const char* file : kOwnFiles) {
    RIGCAL_ASSIGN_OR_RETURN(const bool closed, CloseToOthers(path_ / file));
    changed |= closed;
  }
  RIGCAL_ASSIGN_OR_RETURN(const bool closed, CloseToOthers(path_ / kIdentityFolder));
  if (changed || closed) {
    spdlog::warn(
        "data directory {}: other users could read it; now only this one can (modes 0700 "
        "and 0600)",
        path_.string());
  }
  return absl::OkStatus();
}

std::optional<uint64_t> DataDirectory::FreeBytes() const {
  std::error_code error;
  const std::filesystem::space_info space = std::filesystem::space(path_, error);
  if (error) return std::nullopt;
  return space.available;
}

void DataDirectory::FillReserve(size_t bytes) {
  std::error_code error;
  if (std::filesystem::file_size(reserve_file(), error) == bytes && !error) return;
  const std::filesystem::space_info space = std::filesystem::space(path_, error);
  if (error || space.available < 2 * bytes) return;
  const absl::StatusOr<FileDescriptor> reserve = OpenPrivateFile(reserve_file());
  if (!reserve.ok()) {
    spdlog::warn("{}", std::string(reserve.status().message()));
    return;
  }
  if (posix_fallocate(reserve->get(), 0, static_cast<off_t>(bytes)) != 0) ReleaseReserve();
}

void DataDirectory::ReleaseReserve() {
  std::error_code error;
  std::filesystem::remove(reserve_file(), error);
}

}  // namespace rigcal::server

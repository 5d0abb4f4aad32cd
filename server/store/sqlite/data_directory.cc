// SPDX-License-Identifier: Apache-2.0
#include "server/store/sqlite/data_directory.h"

#include <fcntl.h>
#include <spdlog/spdlog.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <string>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "common/file/durable_file.h"
#include "common/status/status_macros.h"

namespace rigcal::server {
namespace {

constexpr mode_t kFolderMode = 0700;
constexpr mode_t kFileMode = 0600;
constexpr char kLockFile[] = "lock";
constexpr const char* kOwnFiles[] = {"rigcal.db", "rigcal.db-wal", "rigcal.db-shm",
                                     kLockFile,   "reserve",       "audit.jsonl"};

absl::Status FileError(std::string_view what, const std::filesystem::path& path, int error) {
  const std::string message =
      absl::StrCat(std::string(what), " ", path.string(), ": ", std::strerror(error));
  if (error == ENOSPC || error == EDQUOT) return absl::ResourceExhaustedError(message);
  return absl::FailedPreconditionError(
      absl::StrCat(message, "; check the data directory and its permissions"));
}

absl::Status CreateDirectory(const std::filesystem::path& path) {
  std::error_code error;
  const std::filesystem::path whole = std::filesystem::absolute(path).lexically_normal();
  const std::filesystem::path folder = whole.has_filename() ? whole : whole.parent_path();
  std::filesystem::create_directories(folder.parent_path(), error);
  if (error) return FileError("creating data directory", path, error.value());
  if (mkdir(folder.c_str(), kFolderMode) == 0) {
    RIGCAL_RETURN_IF_ERROR(SyncFolder(folder.parent_path()));
  } else if (errno != EEXIST) {
    return FileError("creating data directory", path, errno);
  }
  return absl::OkStatus();
}

// Whoever holds the folder has written its pid into the lock file, unless that was deleted.
absl::Status InUse(const std::filesystem::path& path) {
  std::string owner;
  std::ifstream(path / kLockFile) >> owner;
  return absl::FailedPreconditionError(
      absl::StrCat("data directory ", path.string(), " is in use by another server (pid ",
                   owner.empty() ? "unknown: its file `lock` is gone" : owner,
                   "); stop it or give another --data-dir"));
}

// Mode bits that others than the owner have; 0 also where there is no such file, or it is not ours.
mode_t BitsOfOthers(const std::filesystem::path& path) {
  struct stat entry = {};
  if (lstat(path.c_str(), &entry) != 0 || entry.st_uid != geteuid()) return 0;
  if (!S_ISREG(entry.st_mode) && !S_ISDIR(entry.st_mode)) return 0;
  // A folder such as /tmp, which everybody shares, cannot be closed to others.
  if (S_ISDIR(entry.st_mode) && (entry.st_mode & S_ISVTX) != 0) return 0;
  return entry.st_mode & 077;
}

}  // namespace

absl::StatusOr<std::unique_ptr<DataDirectory>> DataDirectory::Open(
    const std::filesystem::path& path) {
  RIGCAL_RETURN_IF_ERROR(CreateDirectory(path));
  const int folder_fd = open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (folder_fd < 0) return FileError("opening data directory", path, errno);
  std::unique_ptr<DataDirectory> directory(new DataDirectory(path, -1, folder_fd));
  if (flock(folder_fd, LOCK_EX | LOCK_NB) != 0) {
    if (errno == EWOULDBLOCK) return InUse(path);
    return FileError("locking data directory", path, errno);
  }
  const std::filesystem::path lock_file = path / kLockFile;
  const int fd = open(lock_file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, kFileMode);
  if (fd < 0) return FileError("opening lock file", lock_file, errno);
  directory->lock_fd_ = fd;
  // Servers of earlier releases lock this file only.
  if (flock(fd, LOCK_EX | LOCK_NB) != 0) {
    if (errno == EWOULDBLOCK) return InUse(path);
    return FileError("locking", lock_file, errno);
  }
  const std::string pid = std::to_string(getpid());
  // Only for messages: a full disk must not keep a server from starting.
  if (ftruncate(fd, 0) == 0) {
    [[maybe_unused]] const ssize_t written = pwrite(fd, pid.data(), pid.size(), 0);
  }
  // SQLite gives its other files the mode of the database.
  const int database_fd =
      open(directory->database_file().c_str(), O_RDWR | O_CREAT | O_CLOEXEC, kFileMode);
  if (database_fd < 0) {
    return FileError("opening database", directory->database_file(), errno);
  }
  close(database_fd);  // SQLite has not opened it yet: no lock of its gets lost
  directory->MakePrivate();
  return directory;
}

DataDirectory::~DataDirectory() {
  if (lock_fd_ >= 0) close(lock_fd_);
  if (folder_fd_ >= 0) close(folder_fd_);
}

void DataDirectory::MakePrivate() const {
  bool changed = false;
  const auto change = [&](const std::filesystem::path& path, mode_t mode) {
    if (BitsOfOthers(path) == 0) return;
    if (chmod(path.c_str(), mode) == 0) {
      changed = true;
    } else {
      spdlog::warn("others can read {}: {}; run chmod {:o} on it", path.string(),
                   std::strerror(errno), mode);
    }
  };
  change(path_, kFolderMode);
  for (const char* file : kOwnFiles) change(path_ / file, kFileMode);
  if (changed) {
    spdlog::warn(
        "data directory {}: other users could read it; now only this one can (modes 0700 "
        "and 0600)",
        path_.string());
  }
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
  const int fd = open(reserve_file().c_str(), O_RDWR | O_CREAT | O_CLOEXEC, kFileMode);
  if (fd < 0) return;
  const bool filled = posix_fallocate(fd, 0, static_cast<off_t>(bytes)) == 0;
  close(fd);
  if (!filled) ReleaseReserve();
}

void DataDirectory::ReleaseReserve() {
  std::error_code error;
  std::filesystem::remove(reserve_file(), error);
}

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#include "server/store/sqlite/data_directory.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"

namespace rigcal::server {
namespace {

absl::Status FileError(std::string_view what, const std::filesystem::path& path, int error) {
  const std::string message =
      absl::StrCat(std::string(what), " ", path.string(), ": ", std::strerror(error));
  if (error == ENOSPC || error == EDQUOT) return absl::ResourceExhaustedError(message);
  return absl::FailedPreconditionError(
      absl::StrCat(message, "; check the data directory and its permissions"));
}

// A folder's own entry survives a power cut only when its parent is synced.
void SyncDirectory(const std::filesystem::path& path) {
  const int fd = open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return;
  fsync(fd);
  close(fd);
}

absl::Status CreateDirectory(const std::filesystem::path& path) {
  std::error_code error;
  if (std::filesystem::create_directories(path, error)) {
    SyncDirectory(std::filesystem::absolute(path).parent_path());
  }
  if (error) return FileError("creating data directory", path, error.value());
  return absl::OkStatus();
}

std::string ReadOwner(int fd) {
  char text[32] = {};
  const ssize_t size = pread(fd, text, sizeof(text) - 1, 0);
  const std::string owner(text, size > 0 ? static_cast<size_t>(size) : 0);
  return owner.empty() ? "unknown" : owner;
}

}  // namespace

absl::StatusOr<std::unique_ptr<DataDirectory>> DataDirectory::Open(
    const std::filesystem::path& path) {
  RIGCAL_RETURN_IF_ERROR(CreateDirectory(path));
  const std::filesystem::path lock_file = path / "lock";
  const int fd = open(lock_file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (fd < 0) return FileError("opening lock file", lock_file, errno);
  std::unique_ptr<DataDirectory> directory(new DataDirectory(path, fd));
  if (flock(fd, LOCK_EX | LOCK_NB) != 0) {
    if (errno != EWOULDBLOCK) return FileError("locking", lock_file, errno);
    return absl::FailedPreconditionError(
        absl::StrCat("data directory ", path.string(), " is in use by another server (pid ",
                     ReadOwner(fd), "); stop it or give another --data-dir"));
  }
  const std::string pid = std::to_string(getpid());
  // Only for the message above: a full disk must not keep a server from starting.
  if (ftruncate(fd, 0) == 0) {
    [[maybe_unused]] const ssize_t written = pwrite(fd, pid.data(), pid.size(), 0);
  }
  return directory;
}

DataDirectory::~DataDirectory() {
  if (lock_fd_ >= 0) close(lock_fd_);
}

void DataDirectory::FillReserve(size_t bytes) {
  std::error_code error;
  if (std::filesystem::file_size(reserve_file(), error) == bytes && !error) return;
  const std::filesystem::space_info space = std::filesystem::space(path_, error);
  if (error || space.available < 2 * bytes) return;
  const int fd = open(reserve_file().c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
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

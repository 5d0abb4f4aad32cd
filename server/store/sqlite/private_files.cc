// SPDX-License-Identifier: Apache-2.0
#include "server/store/sqlite/private_files.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"

namespace rigcal::server {
namespace {

absl::Status PrivateFileError(std::string_view what, const std::filesystem::path& file, int error) {
  const std::string message =
      absl::StrCat(std::string(what), " ", file.string(), ": ", std::strerror(error));
  if (error == ENOSPC || error == EDQUOT) {
    return absl::ResourceExhaustedError(absl::StrCat(message, "; free space on its disk"));
  }
  return absl::FailedPreconditionError(absl::StrCat(message, "; check the folder and its mode"));
}

absl::Status WriteAll(int fd, std::string_view bytes, const std::filesystem::path& file) {
  while (!bytes.empty()) {
    const ssize_t written = write(fd, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return PrivateFileError("writing", file, errno);
    bytes.remove_prefix(static_cast<size_t>(written));
  }
  return fsync(fd) == 0 ? absl::OkStatus() : PrivateFileError("syncing", file, errno);
}

}  // namespace

absl::Status CreatePrivateFile(const std::filesystem::path& file) {
  return WritePrivateFile(file, "");
}

absl::Status WritePrivateFile(const std::filesystem::path& file, std::string_view bytes) {
  const int fd = open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (fd < 0) return PrivateFileError("creating", file, errno);
  const absl::Status status = WriteAll(fd, bytes, file);
  close(fd);
  return status;
}

absl::StatusOr<std::string> ReadWholeFile(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  if (!stream) return PrivateFileError("reading", file, errno == 0 ? EIO : errno);
  return bytes;
}

absl::Status SyncAndRename(const std::filesystem::path& from, const std::filesystem::path& to) {
  const int fd = open(from.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return PrivateFileError("opening", from, errno);
  const bool synced = fsync(fd) == 0;
  const int error = errno;
  close(fd);
  if (!synced) return PrivateFileError("syncing", from, error);
  if (rename(from.c_str(), to.c_str()) != 0) return PrivateFileError("naming", to, errno);
  SyncFolder(std::filesystem::absolute(to).parent_path());
  return absl::OkStatus();
}

void SyncFolder(const std::filesystem::path& folder) {
  const int fd = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return;
  fsync(fd);
  close(fd);
}

}  // namespace rigcal::server

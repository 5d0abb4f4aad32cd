// SPDX-License-Identifier: Apache-2.0
#include "common/file/durable_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "common/file/file_descriptor.h"
#include "common/file/file_error.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

namespace fs = std::filesystem;

constexpr size_t kSmallBytes = size_t{1} << 20;
constexpr size_t kReadStepBytes = size_t{1} << 16;
constexpr mode_t kPrivateMode = 0600;
constexpr mode_t kOutputMode = 0666;  // less the umask
constexpr char kUnfinished[] = ".new";

fs::path FolderOf(const fs::path& path) {
  return path.has_parent_path() ? path.parent_path() : fs::path(".");
}

// "tokens.json.4711-3.new": other processes and threads write to files of their own.
fs::path TemporaryName(const fs::path& path) {
  static std::atomic<uint64_t> count = 0;
  return absl::StrCat(path.string(), ".", getpid(), "-", ++count, kUnfinished);
}

bool IsTemporaryName(std::string_view name) {
  if (!name.ends_with(kUnfinished)) return false;
  name.remove_suffix(sizeof(kUnfinished) - 1);
  const size_t dot = name.rfind('.');
  return dot != std::string_view::npos && dot > 0 && dot + 1 < name.size() &&
         name.find_first_not_of("0123456789-", dot + 1) == std::string_view::npos;
}

// Errors name the file that was asked for, whatever its bytes are written to at first.
absl::Status WriteAndSync(int descriptor, std::string_view bytes, const fs::path& path) {
  while (!bytes.empty()) {
    const ssize_t written = write(descriptor, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return FileError("write", path, errno);
    // No error that says why, and trying again for ever would hang.
    if (written == 0) return FileError("write", path, EIO);
    bytes.remove_prefix(static_cast<size_t>(written));
  }
  return fsync(descriptor) == 0 ? absl::OkStatus() : FileError("sync", path, errno);
}

// Why a file cannot be made: the folder, where that is what is missing.
absl::Status CreateError(const fs::path& path, int error) {
  std::error_code ignored;
  if (error != ENOENT || fs::exists(FolderOf(path), ignored)) {
    return FileError("create", path, error);
  }
  return absl::NotFoundError(absl::StrCat("cannot create ", path.string(), ": there is no folder ",
                                          FolderOf(path).string(), "; make it first"));
}

// A new file; removed again after an error. `shown` is what errors call it.
absl::Status CreateFile(const fs::path& path, const fs::path& shown, std::string_view bytes,
                        mode_t mode) {
  const FileDescriptor file(
      open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, mode));
  if (!file.is_open()) return CreateError(shown, errno);
  absl::Status status;
  // The umask may have taken bits of the owner's as well.
  if (mode == kPrivateMode && fchmod(file.get(), mode) != 0) {
    status = FileError("protect", shown, errno);
  }
  if (status.ok()) status = WriteAndSync(file.get(), bytes, shown);
  if (!status.ok()) unlink(path.c_str());
  return status;
}

absl::Status ReplaceFile(const fs::path& path, std::string_view bytes, mode_t mode) {
  const fs::path temporary = TemporaryName(path);
  unlink(temporary.c_str());  // of a process with the same number that was killed
  RIGCAL_RETURN_IF_ERROR(CreateFile(temporary, path, bytes, mode));
  if (rename(temporary.c_str(), path.c_str()) != 0) {
    absl::Status status = FileError("replace", path, errno);
    unlink(temporary.c_str());
    return status;
  }
  return SyncFolder(FolderOf(path));
}

}  // namespace

absl::Status WriteDurableFile(const fs::path& path, std::string_view text) {
  return ReplaceFile(path, text, kPrivateMode);
}

absl::Status WriteOutputFile(const fs::path& path, std::string_view bytes) {
  struct stat about = {};
  if (lstat(path.c_str(), &about) == 0 && !S_ISREG(about.st_mode) && !S_ISLNK(about.st_mode)) {
    return absl::FailedPreconditionError(
        absl::StrCat("cannot write ", path.string(),
                     ": it is a folder, a device or a pipe; name a file to write or to replace"));
  }
  return ReplaceFile(path, bytes, kOutputMode);
}

absl::Status CreatePrivateFile(const fs::path& path, std::string_view bytes) {
  return CreateFile(path, path, bytes, kPrivateMode);
}

absl::Status SyncAndRename(const fs::path& from, const fs::path& to) {
  const FileDescriptor file(open(from.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC));
  if (!file.is_open()) return FileError("open", from, errno);
  if (fsync(file.get()) != 0) return FileError("sync", from, errno);
  if (from != to && rename(from.c_str(), to.c_str()) != 0) {
    return FileError("replace", to, errno);
  }
  return SyncFolder(FolderOf(to));
}

absl::Status SyncFolder(const fs::path& folder) {
  const FileDescriptor open_folder(open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!open_folder.is_open()) return FileError("open the folder", folder, errno);
  // EINVAL: the file system does not sync folders.
  if (fsync(open_folder.get()) == 0 || errno == EINVAL) return absl::OkStatus();
  return FileError("sync the folder", folder, errno);
}

absl::StatusOr<std::string> ReadWholeFile(const fs::path& path, size_t max_bytes) {
  // Opening a pipe would wait for who writes to it.
  const FileDescriptor file(open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
  if (!file.is_open()) return FileError("read", path, errno);
  struct stat about = {};
  if (fstat(file.get(), &about) != 0) return FileError("read", path, errno);
  if (!S_ISREG(about.st_mode)) {
    return absl::FailedPreconditionError(
        absl::StrCat("cannot read ", path.string(), ": it is a folder, a device or a pipe"));
  }
  std::string text;
  for (size_t filled = 0;;) {
    text.resize(std::min(filled + kReadStepBytes, max_bytes + 1));
    const ssize_t count = read(file.get(), text.data() + filled, text.size() - filled);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return FileError("read", path, errno);
    filled += static_cast<size_t>(count);
    if (filled > max_bytes) {
      return absl::OutOfRangeError(
          absl::StrCat(path.string(), " has more than ", max_bytes, " bytes"));
    }
    if (count > 0) continue;
    text.resize(filled);
    return text;
  }
}

absl::StatusOr<std::string> ReadSmallFile(const fs::path& path) {
  return ReadWholeFile(path, kSmallBytes);
}

void RemoveUnfinishedFiles(const fs::path& folder) {
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    std::error_code ignored;
    if (IsTemporaryName(entry->path().filename().string()) &&
        fs::is_regular_file(entry->symlink_status(ignored))) {
      fs::remove(entry->path(), ignored);
    }
  }
}

}  // namespace rigcal

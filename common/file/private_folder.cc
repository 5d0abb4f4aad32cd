// SPDX-License-Identifier: Apache-2.0
#include "common/file/private_folder.h"

#include <fcntl.h>
#include <sys/stat.h>

#include <cerrno>
#include <string>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/file/durable_file.h"
#include "common/file/file_error.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

namespace fs = std::filesystem;

constexpr mode_t kFolderMode = 0700;
constexpr mode_t kFileMode = 0600;
constexpr mode_t kBitsOfOthers = 077;
constexpr mode_t kOthersWrite = 022;

// Root can do everything anyway.
absl::Status CheckOwnerOf(const struct stat& about, const fs::path& path) {
  if (about.st_uid == geteuid() || about.st_uid == 0) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat(path.string(), " belongs to another user (", about.st_uid,
                   "), who could make this program (", "user ", geteuid(),
                   ") write elsewhere; run it as that user, name another folder, or take it ",
                   "over with chown"));
}

}  // namespace

absl::StatusOr<FileDescriptor> OpenPrivateFolder(const fs::path& path) {
  std::error_code error;
  const fs::path whole = fs::absolute(path, error).lexically_normal();
  const fs::path folder = whole.has_filename() ? whole : whole.parent_path();
  fs::create_directories(folder.parent_path(), error);
  if (error) return FileError("create", path, error.value());
  const bool made = mkdir(folder.c_str(), kFolderMode) == 0;
  if (!made && errno != EEXIST) return FileError("create", path, errno);
  FileDescriptor descriptor(open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  struct stat about = {};
  if (!descriptor.is_open() || fstat(descriptor.get(), &about) != 0) {
    return FileError("open the folder", path, errno);
  }
  RIGCAL_RETURN_IF_ERROR(CheckOwnerOf(about, path));
  if (made) RIGCAL_RETURN_IF_ERROR(SyncFolder(folder.parent_path()));
  const bool is_shared = (about.st_mode & S_ISVTX) != 0;
  if (is_shared || (about.st_mode & kBitsOfOthers) == 0 ||
      fchmod(descriptor.get(), kFolderMode) == 0) {
    return descriptor;
  }
  // Root's, with a group for those who may use it, is how its administrator wants it.
  const bool is_for_group = about.st_uid != geteuid() && (about.st_mode & S_IWOTH) == 0;
  if (is_for_group || (about.st_mode & kOthersWrite) == 0) return descriptor;
  return absl::FailedPreconditionError(
      absl::StrFormat("other users can write in %s (mode %04o), and could make this program write "
                      "elsewhere: run chmod 700 on it, or name another folder",
                      path.string(), about.st_mode & 07777));
}

absl::Status MakePrivateFolder(const fs::path& path) { return OpenPrivateFolder(path).status(); }

absl::StatusOr<FileDescriptor> OpenPrivateFile(const fs::path& path) {
  // Opening a pipe would wait for its other end.
  FileDescriptor file(
      open(path.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, kFileMode));
  struct stat about = {};
  if (!file.is_open() || fstat(file.get(), &about) != 0) return FileError("open", path, errno);
  if (!S_ISREG(about.st_mode)) {
    return absl::FailedPreconditionError(
        absl::StrCat("cannot open ", path.string(), ": it is no file; move it away"));
  }
  RIGCAL_RETURN_IF_ERROR(CheckOwnerOf(about, path));
  if ((about.st_mode & 0777) != kFileMode && about.st_uid == geteuid() &&
      fchmod(file.get(), kFileMode) != 0) {
    return FileError("protect", path, errno);
  }
  return file;
}

absl::StatusOr<bool> CloseToOthers(const fs::path& path) {
  struct stat about = {};
  if (lstat(path.c_str(), &about) != 0) {
    return errno == ENOENT ? absl::StatusOr<bool>(false) : FileError("look at", path, errno);
  }
  const bool is_folder = S_ISDIR(about.st_mode);
  if ((!is_folder && !S_ISREG(about.st_mode)) || about.st_uid != geteuid()) return false;
  bool changed = (about.st_mode & kBitsOfOthers) != 0;
  if (changed && chmod(path.c_str(), is_folder ? kFolderMode : kFileMode) != 0) {
    return FileError("protect", path, errno);
  }
  if (!is_folder) return changed;
  std::error_code error;
  for (fs::directory_iterator entry(path, error), end; !error && entry != end;
       entry.increment(error)) {
    RIGCAL_ASSIGN_OR_RETURN(const bool closed, CloseToOthers(entry->path()));
    changed |= closed;
  }
  if (error) return FileError("list", path, error.value());
  return changed;
}

absl::Status CheckOwner(const fs::path& path) {
  struct stat about = {};
  if (lstat(path.c_str(), &about) != 0) {
    return errno == ENOENT ? absl::OkStatus() : FileError("look at", path, errno);
  }
  return CheckOwnerOf(about, path);
}

}  // namespace rigcal

// SPDX-License-Identifier: Apache-2.0
#include "agent/spool/disk/file_system.h"

#include <dirent.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"

namespace rigcal::agent {
namespace {

absl::Status FileError(absl::string_view what, absl::string_view path, int error = errno) {
  const std::string text = absl::StrCat("cannot ", what, " ", path, ": ", std::strerror(error));
  if (error == ENOSPC || error == EDQUOT) return absl::ResourceExhaustedError(text);
  if (error == ENOENT) return absl::NotFoundError(text);
  return absl::InternalError(text);
}

// Repeats a call that a signal interrupted.
template <typename Call>
auto Uninterrupted(Call call) {
  auto result = call();
  while (result < 0 && errno == EINTR) result = call();
  return result;
}

class RealFile final : public SpoolFile {
 public:
  RealFile(int fd, std::string path) : fd_(fd), path_(std::move(path)) {}
  ~RealFile() override { close(fd_); }

  absl::Status WriteAt(uint64_t offset, std::string_view bytes) override {
    while (!bytes.empty()) {
      const ssize_t written = Uninterrupted(
          [&] { return pwrite(fd_, bytes.data(), bytes.size(), static_cast<off_t>(offset)); });
      if (written < 0) return FileError("write", path_);
      if (written == 0) return FileError("write", path_, EIO);
      offset += static_cast<uint64_t>(written);
      bytes.remove_prefix(static_cast<size_t>(written));
    }
    return absl::OkStatus();
  }

  absl::StatusOr<std::string> ReadAt(uint64_t offset, size_t size) override {
    std::string bytes(size, '\0');
    size_t filled = 0;
    while (filled < size) {
      const ssize_t count = Uninterrupted([&] {
        return pread(fd_, bytes.data() + filled, size - filled,
                     static_cast<off_t>(offset + filled));
      });
      if (count < 0) return FileError("read", path_);
      if (count == 0) break;
      filled += static_cast<size_t>(count);
    }
    bytes.resize(filled);
    return bytes;
  }

  absl::Status Truncate(uint64_t size) override {
    if (Uninterrupted([&] { return ftruncate(fd_, static_cast<off_t>(size)); }) == 0) {
      return absl::OkStatus();
    }
    return FileError("truncate", path_);
  }

  absl::Status Sync() override {
    return Uninterrupted([&] { return fdatasync(fd_); }) == 0 ? absl::OkStatus()
                                                              : FileError("sync", path_);
  }

 private:
  const int fd_;
  const std::string path_;
};

// Closed at the end.
struct OpenDescriptor {
  explicit OpenDescriptor(int opened) : fd(opened) {}
  ~OpenDescriptor() { close(fd); }
  OpenDescriptor(const OpenDescriptor&) = delete;
  OpenDescriptor& operator=(const OpenDescriptor&) = delete;

  const int fd;
};

class PosixFileSystem final : public FileSystem {
 public:
  absl::Status CreateFolder(const std::string& path) override {
    if (mkdir(path.c_str(), 0700) == 0) return absl::OkStatus();
    return errno == EEXIST ? absl::OkStatus() : FileError("create the folder", path);
  }

  absl::StatusOr<std::vector<Entry>> List(const std::string& folder) override {
    DIR* const directory = opendir(folder.c_str());
    if (directory == nullptr) return FileError("list", folder);
    std::vector<Entry> entries;
    errno = 0;
    while (const dirent* entry = readdir(directory)) {
      struct stat about {};
      const std::string name = entry->d_name;
      if (fstatat(dirfd(directory), entry->d_name, &about, AT_SYMLINK_NOFOLLOW) == 0 &&
          S_ISREG(about.st_mode)) {
        entries.push_back({.name = name, .size = static_cast<uint64_t>(about.st_size)});
      }
      errno = 0;
    }
    const int error = errno;
    closedir(directory);
    if (error != 0) return FileError("list", folder, error);
    return entries;
  }

  absl::StatusOr<std::shared_ptr<SpoolFile>> Create(const std::string& path) override {
    return OpenFile(path, O_RDWR | O_CREAT | O_TRUNC);
  }
  absl::StatusOr<std::shared_ptr<SpoolFile>> Open(const std::string& path) override {
    return OpenFile(path, O_RDWR);
  }

  absl::Status Rename(const std::string& from, const std::string& to) override {
    return std::rename(from.c_str(), to.c_str()) == 0 ? absl::OkStatus()
                                                      : FileError("rename", from);
  }

  absl::Status Remove(const std::string& path) override {
    if (unlink(path.c_str()) == 0 || errno == ENOENT) return absl::OkStatus();
    return FileError("remove", path);
  }

  absl::Status SyncFolder(const std::string& path) override {
    const int fd = open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd < 0) return FileError("open", path);
    const bool synced = Uninterrupted([&] { return fsync(fd); }) == 0;
    const absl::Status status = synced ? absl::OkStatus() : FileError("sync", path);
    close(fd);
    return status;
  }

  absl::StatusOr<std::shared_ptr<void>> Lock(const std::string& path) override {
    const int fd = open(path.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0600);
    if (fd < 0) return FileError("open", path);
    const auto lock = std::make_shared<OpenDescriptor>(fd);
    if (flock(fd, LOCK_EX | LOCK_NB) == 0) return lock;
    if (errno != EWOULDBLOCK) return FileError("lock", path);
    return absl::AlreadyExistsError(absl::StrCat("another agent uses the spool (", path,
                                                 " is locked); stop it, or give this one another "
                                                 "--state-dir"));
  }

 private:
  static absl::StatusOr<std::shared_ptr<SpoolFile>> OpenFile(const std::string& path, int flags) {
    const int fd = open(path.c_str(), flags | O_CLOEXEC | O_NOFOLLOW, 0600);
    if (fd < 0) return FileError("open", path);
    return std::make_shared<RealFile>(fd, path);
  }
};

}  // namespace

FileSystem& RealFileSystem() {
  static auto* const kFileSystem = new PosixFileSystem;
  return *kFileSystem;
}

}  // namespace rigcal::agent

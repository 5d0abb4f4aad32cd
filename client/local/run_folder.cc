// SPDX-License-Identifier: Apache-2.0
#include "client/local/run_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"

namespace rigcal::client {
namespace {

namespace fs = std::filesystem;

constexpr char kPrefix[] = "rigcal-local-";
constexpr char kLockName[] = "lock";

absl::Status CannotMake(const fs::path& path, const std::string& why) {
  return absl::FailedPreconditionError(
      absl::StrCat("cannot create the folder ", path.string(), ": ", why));
}

// Locked before it gets its name: a folder whose lock is free belongs to a dead run.
absl::StatusOr<int> Lock(const fs::path& folder) {
  const fs::path file = folder / kLockName;
  const fs::path unnamed = folder / "lock.new";
  const int lock = open(unnamed.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0600);
  if (lock >= 0 && flock(lock, LOCK_EX | LOCK_NB) == 0 &&
      rename(unnamed.c_str(), file.c_str()) == 0) {
    return lock;
  }
  absl::Status status = CannotMake(file, strerror(errno));
  if (lock >= 0) close(lock);
  return status;
}

bool IsOurs(const fs::path& folder) {
  struct stat found = {};
  return lstat(folder.c_str(), &found) == 0 && S_ISDIR(found.st_mode) && found.st_uid == geteuid();
}

void RemoveDeadRuns(const fs::path& parent) {
  std::error_code error;
  std::vector<fs::path> dead;
  fs::directory_iterator entry(parent, error);
  for (; !error && entry != fs::directory_iterator(); entry.increment(error)) {
    const fs::path& folder = entry->path();
    const std::string name = folder.filename().string();
    if (!name.starts_with(kPrefix) || name.size() != strlen(kPrefix) + 6 || !IsOurs(folder)) {
      continue;
    }
    const int lock = open((folder / kLockName).c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW);
    if (lock < 0) continue;
    if (flock(lock, LOCK_EX | LOCK_NB) == 0) dead.push_back(folder);
    close(lock);
  }
  for (const fs::path& folder : dead) fs::remove_all(folder, error);
}

absl::StatusOr<fs::path> MakeTemporary() {
  std::error_code error;
  const fs::path parent = fs::absolute(fs::temp_directory_path(error), error);
  if (error) {
    return absl::FailedPreconditionError(
        absl::StrCat("there is no folder for temporary files (", error.message(), "); set TMPDIR"));
  }
  RemoveDeadRuns(parent);
  std::string name = (parent / (std::string(kPrefix) + "XXXXXX")).string();
  if (mkdtemp(name.data()) == nullptr) return CannotMake(name, strerror(errno));
  return fs::path(name);
}

absl::StatusOr<fs::path> MakeKept(const fs::path& keep) {
  std::error_code error;
  const fs::path path = fs::absolute(keep, error).lexically_normal();
  fs::create_directories(path, error);
  const bool empty = !error && fs::is_empty(path, error);
  if (error) return CannotMake(path, error.message());
  if (!empty) {
    return absl::FailedPreconditionError(
        absl::StrCat("the folder ", path.string(),
                     " to keep the run in is not empty; name a new one, runs are not mixed"));
  }
  return path;
}

}  // namespace

absl::StatusOr<RunFolder> RunFolder::Create(const fs::path& keep) {
  absl::StatusOr<fs::path> path = keep.empty() ? MakeTemporary() : MakeKept(keep);
  if (!path.ok()) return path.status();
  RunFolder folder(*std::move(path), !keep.empty(), -1);
  if (!folder.stays_) {
    absl::StatusOr<int> lock = Lock(folder.path_);
    if (!lock.ok()) return lock.status();
    folder.lock_ = *lock;
  }
  for (const fs::path& part : {folder.Store(), folder.Logs(), folder.Agents()}) {
    std::error_code error;
    fs::create_directory(part, error);
    if (error) return CannotMake(part, error.message());
  }
  return folder;
}

RunFolder::RunFolder(RunFolder&& other) noexcept
    : path_(std::exchange(other.path_, fs::path())),
      stays_(other.stays_),
      lock_(std::exchange(other.lock_, -1)) {}

RunFolder::~RunFolder() {
  if (!stays_ && !path_.empty()) {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  if (lock_ >= 0) close(lock_);
}

}  // namespace rigcal::client

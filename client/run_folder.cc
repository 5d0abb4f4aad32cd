// SPDX-License-Identifier: Apache-2.0
#include "client/run_folder.h"

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"

namespace rigcal::client {
namespace {

namespace fs = std::filesystem;

absl::Status CannotMake(const fs::path& path, const std::string& why) {
  return absl::FailedPreconditionError(
      absl::StrCat("cannot make the folder ", path.string(), ": ", why));
}

absl::StatusOr<fs::path> MakeTemporary() {
  std::error_code error;
  const fs::path parent = fs::absolute(fs::temp_directory_path(error), error);
  if (error) {
    return absl::FailedPreconditionError(
        absl::StrCat("there is no folder for temporary files (", error.message(), "); set TMPDIR"));
  }
  std::string name = (parent / "rigcal-local-XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr) return CannotMake(name, strerror(errno));
  return fs::path(name);
}

absl::StatusOr<fs::path> MakeKept(const fs::path& keep) {
  std::error_code error;
  const fs::path path = fs::absolute(keep, error).lexically_normal();
  fs::create_directories(path, error);
  if (error) return CannotMake(path, error.message());
  const bool empty = fs::is_empty(path, error);
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
  RunFolder folder(*std::move(path), !keep.empty());
  for (const fs::path& part : {folder.Store(), folder.Logs(), folder.Agents()}) {
    std::error_code error;
    fs::create_directory(part, error);
    if (error) return CannotMake(part, error.message());
  }
  return folder;
}

RunFolder::RunFolder(RunFolder&& other) noexcept
    : path_(std::exchange(other.path_, fs::path())), stays_(other.stays_) {}

RunFolder::~RunFolder() {
  if (stays_ || path_.empty()) return;
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

}  // namespace rigcal::client

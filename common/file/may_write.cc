// SPDX-License-Identifier: Apache-2.0
#include "common/file/may_write.h"

#include <system_error>

#include "absl/strings/str_cat.h"

namespace rigcal {

absl::Status CheckMayWrite(const std::filesystem::path& path, bool replace) {
  std::error_code error;
  if (replace || !std::filesystem::is_regular_file(path, error)) return absl::OkStatus();
  return absl::AlreadyExistsError(absl::StrCat(
      path.string(), " exists; --force replaces it, another --output leaves it as it is"));
}

absl::Status CheckOutputFile(const std::filesystem::path& path, bool replace,
                             std::string_view option) {
  std::error_code error;
  const std::filesystem::path folder = path.parent_path();
  if (!folder.empty() && !std::filesystem::exists(folder, error)) {
    return absl::NotFoundError(absl::StrCat("cannot write ", path.string(), ": there is no folder ",
                                            folder.string(), "; make it, or name another one with ",
                                            std::string(option)));
  }
  if (replace || !std::filesystem::is_regular_file(path, error)) return absl::OkStatus();
  return absl::AlreadyExistsError(absl::StrCat(path.string(),
                                               " exists; --force replaces it, another ",
                                               std::string(option), " leaves it as it is"));
}

}  // namespace rigcal

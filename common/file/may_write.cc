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

}  // namespace rigcal

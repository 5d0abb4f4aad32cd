// SPDX-License-Identifier: Apache-2.0
#include "common/file/file_error.h"

#include <cerrno>
#include <cstring>
#include <string>

#include "absl/strings/str_cat.h"

namespace rigcal {

absl::Status FileError(std::string_view what, const std::filesystem::path& path, int error) {
  const std::string text =
      absl::StrCat("cannot ", std::string(what), " ", path.string(), ": ", std::strerror(error));
  switch (error) {
    case ENOENT:
      return absl::NotFoundError(text);
    case ENOSPC:
    case EDQUOT:
    case EFBIG:
      return absl::ResourceExhaustedError(absl::StrCat(text, "; free space on its disk"));
    case EIO:
      return absl::InternalError(text);
    case ELOOP:
      // Of open with O_NOFOLLOW.
      return absl::FailedPreconditionError(absl::StrCat(
          text, "; it is a link, and links are not followed here: put the file itself there"));
    default:
      return absl::FailedPreconditionError(text);
  }
}

}  // namespace rigcal

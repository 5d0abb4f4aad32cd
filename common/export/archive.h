// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>

#include "absl/status/statusor.h"

namespace rigcal {

// A file that has not been written anywhere yet.
struct ExportFile {
  std::string name;  // without a folder
  std::string content;
};

// A ZIP archive of these files; the same files give the same bytes. INTERNAL: no memory, or a name
// that an archive cannot hold.
absl::StatusOr<std::string> ZipOf(std::span<const ExportFile> files);
// The same as a TAR archive (POSIX 1003.1-2001, ustar) compressed with gzip; names may have
// folders.
absl::StatusOr<std::string> TarGzOf(std::span<const ExportFile> files);

}  // namespace rigcal

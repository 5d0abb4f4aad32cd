// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace rigcal {

// Files that are whole or not there, also after a power cut. Errors of all functions name the path,
// with the codes of FileError. All may be called by several threads and processes at a time.

// Puts a file of mode 0600 with this text in the place of `path`, whatever the umask: written to a
// temporary file of a name of its own in the same folder, synced, renamed, the folder synced. OK:
// the new text is on the disk. An error before the rename leaves the old file as it was; an error
// of the last step (which says "sync the folder") leaves the new one, which a power cut may undo.
// No link is followed: one at `path` is replaced.
absl::Status WriteDurableFile(const std::filesystem::path& path, std::string_view text);

// The same for a file that a user has asked for: its mode is as the umask says. Devices and pipes
// are refused, which a rename would replace.
absl::Status WriteOutputFile(const std::filesystem::path& path, std::string_view bytes);

// A new file of mode 0600 with these bytes, synced. FAILED_PRECONDITION: there is something of that
// name.
absl::Status CreatePrivateFile(const std::filesystem::path& path, std::string_view bytes = {});

// Gives a finished file another name in the same folder, or syncs it where both are the same; both
// file and name survive a power cut.
absl::Status SyncAndRename(const std::filesystem::path& from, const std::filesystem::path& to);

// The names in a folder survive a power cut. OK on file systems that cannot do this.
absl::Status SyncFolder(const std::filesystem::path& folder);

// At most 1 MiB; OUT_OF_RANGE: it has more. Reads nothing but regular files: a pipe could not end.
absl::StatusOr<std::string> ReadSmallFile(const std::filesystem::path& path);
absl::StatusOr<std::string> ReadWholeFile(const std::filesystem::path& path, size_t max_bytes);

// Removes the temporary files that functions above have left in a folder when they were killed. For
// who has the folder for himself.
void RemoveUnfinishedFiles(const std::filesystem::path& folder);

}  // namespace rigcal

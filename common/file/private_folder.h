// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/file/file_descriptor.h"

namespace rigcal {

// Folders with secrets and with the files that a program writes. Who owns such a folder, or may
// write in it, could put links there that make the program write elsewhere; so both are checked.
// Errors name the path and say what to do.

// A folder that only its owner may enter (0700), made where it is missing with the folders above
// it. Returns it open. One of this user's that others can enter is closed to them. A folder such as
// /tmp, in which nobody can replace the files of others (mode 1777), stays as it is.
//   FAILED_PRECONDITION  it belongs to another user, or others can write in it and that cannot be
//                        changed
//   others               as FileError
absl::StatusOr<FileDescriptor> OpenPrivateFolder(const std::filesystem::path& path);
absl::Status MakePrivateFolder(const std::filesystem::path& path);

// A file for reading and writing in such a folder, mode 0600, made where it is missing.
//   FAILED_PRECONDITION  it is a link or no regular file, or belongs to another user
absl::StatusOr<FileDescriptor> OpenPrivateFile(const std::filesystem::path& path);

// Gives a file of this user's the mode 0600, or a folder with everything in it 0700 and 0600. True:
// another user could read something before. What is a link, or not this user's, is left alone.
absl::StatusOr<bool> CloseToOthers(const std::filesystem::path& path);

// FAILED_PRECONDITION: this file, folder or link belongs to another user. OK where there is none.
absl::Status CheckOwner(const std::filesystem::path& path);

}  // namespace rigcal

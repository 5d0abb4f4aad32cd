// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace rigcal::client {

// A recorded camera of a folder: `<camera>.csv` with the markers, or the events of an event camera
// in `<camera>.raw`, `.h5` or `.hdf5`; `<camera>.yaml` with the intrinsics.
struct RecordedCamera {
  std::string camera;
  std::filesystem::path recording;
  bool events = false;
};

struct RecordedFolder {
  std::filesystem::path path;           // absolute
  std::vector<RecordedCamera> cameras;  // by name
  // Warnings for the user: a YAML file without its recording.
  std::vector<std::string> warnings;
};

// Lists the recordings of a folder and reads its intrinsics. NOT_FOUND: no such folder.
// INVALID_ARGUMENT: names every fault at once: no recording, a single camera, two recordings of one
// camera, a missing or malformed YAML file, a file name that cannot be a camera's name.
absl::StatusOr<RecordedFolder> ReadRecordedFolder(const std::filesystem::path& path);

}  // namespace rigcal::client

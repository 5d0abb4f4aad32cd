// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace rigcal::client {

enum class RecordingKind : uint8_t { kMarkers = 1, kEvents, kImages, kVideo };

// A recorded camera of a folder: `<camera>.csv` with the markers, the events of an event camera in
// `<camera>.raw`, `.h5` or `.hdf5`, or, where there is none of these, images in the folder
// `<camera>` or a video `<camera>.mp4` (.mkv, .avi, ...); `<camera>.yaml` with the intrinsics.
struct RecordedCamera {
  std::string camera;
  std::filesystem::path recording;
  RecordingKind kind = RecordingKind::kMarkers;

  bool IsFrames() const { return kind == RecordingKind::kImages || kind == RecordingKind::kVideo; }
};

struct RecordedFolder {
  std::filesystem::path path;           // absolute
  std::vector<RecordedCamera> cameras;  // by name
  // Warnings for the user: a YAML file without its recording, images without a YAML file.
  std::vector<std::string> warnings;
};

// Lists the recordings of a folder and reads its intrinsics. NOT_FOUND: no such folder.
// INVALID_ARGUMENT: names every fault at once: no recording, a single camera, two recordings of one
// camera, a missing or malformed YAML file, a file name that cannot be a camera's name.
absl::StatusOr<RecordedFolder> ReadRecordedFolder(const std::filesystem::path& path);

}  // namespace rigcal::client

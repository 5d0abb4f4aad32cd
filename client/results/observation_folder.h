// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "common/session/observation_batch.h"
#include "rigcal/v1/session.pb.h"

namespace rigcal::client {

// Writes the observations of a session as a recorded rig, which `rigcal local --data` and `rigcal
// triangulate --data` read: for each camera <camera>.csv with a line `time_ns;x0;y0;x1;y1;...`
// (pixels, -1;-1: not seen) for each row, and <camera>.yaml with its intrinsics where it has some.
class ObservationFolder {
 public:
  ObservationFolder(std::filesystem::path folder, bool replace)
      : folder_(std::move(folder)), replace_(replace) {}

  // Makes the folder and writes the intrinsics of these cameras. ALREADY_EXISTS: a file that would
  // be written is there and may not be replaced.
  absl::Status Begin(const std::vector<rigcal::v1::CameraDescription>& cameras);
  // Batches camera by camera, each of a camera of Begin.
  absl::Status Add(const ObservationBatch& batch);
  // Once, at the end.
  absl::Status Finish();

  const std::vector<std::filesystem::path>& files() const { return files_; }
  // What who uses the folder must know.
  const std::vector<std::string>& notes() const { return notes_; }

 private:
  const std::filesystem::path folder_;
  const bool replace_;
  std::string camera_;  // whose rows are being collected
  std::string rows_;
  bool has_sphere_centres_ = false;
  std::vector<std::filesystem::path> files_;
  std::vector<std::string> notes_;
};

}  // namespace rigcal::client

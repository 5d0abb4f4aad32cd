// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"

namespace rigcal::agent {

// A camera that somebody chose from those that the agent offers.
struct ChosenCamera {
  std::string device;       // OfferedCamera::device
  std::string kind;         // "aravis"
  std::string source;       // "aravis:21876543"
  std::string camera;       // name within the rig
  std::string vendor = {};  // as it said when it was chosen
  std::string model = {};
  bool has_lens = false;  // LensPath(camera) is its lens

  friend bool operator==(const ChosenCamera&, const ChosenCamera&) = default;
};

// The chosen cameras of an agent, which it keeps over restarts: cameras.json in its folder, and
// their lenses below lenses/. For one thread.
class ChosenCameras {
 public:
  // None: there is no such file. DATA_LOSS: it is damaged; it is named, and what to do is said.
  static absl::StatusOr<ChosenCameras> Open(std::filesystem::path folder);

  // In the order in which they were chosen. No two have one device or one name.
  const std::vector<ChosenCamera>& cameras() const { return cameras_; }
  // Null: there is none.
  const ChosenCamera* FindDevice(std::string_view device) const;
  const ChosenCamera* FindCamera(std::string_view camera) const;

  // On disk when they return; an error changes nothing and names the file.
  // ALREADY_EXISTS: the device or the name is taken.
  absl::Status Add(ChosenCamera camera);
  // With its lens. NOT_FOUND: there is none of this name.
  absl::Status Remove(const std::string& camera);

  // The lens of a camera that is about to be chosen. Errors name the file.
  absl::Status WriteLens(const std::string& camera, std::string_view yaml) const;
  void RemoveLens(const std::string& camera) const;
  std::filesystem::path LensPath(const std::string& camera) const;

 private:
  explicit ChosenCameras(std::filesystem::path folder) : folder_(std::move(folder)) {}
  absl::Status Save(std::vector<ChosenCamera> cameras);

  std::filesystem::path folder_;
  std::vector<ChosenCamera> cameras_;
};

}  // namespace rigcal::agent

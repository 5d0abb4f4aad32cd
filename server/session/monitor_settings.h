// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace rigcal::server {

// Whether a rig's sessions are compared with its active calibration.
enum class MonitorMode : uint8_t {
  kOff = 1,
  kWatch = 2,   // what has moved is said
  kRepair = 3,  // and repaired
};

// "off", "watch", "repair".
std::string_view MonitorModeName(MonitorMode mode);

// The mode of each rig, in a file of the data directory. Thread-safe.
class MonitorSettings {
 public:
  // Empty `file`: nothing is kept. DATA_LOSS: the file is damaged.
  static absl::StatusOr<std::unique_ptr<MonitorSettings>> Open(std::filesystem::path file);

  MonitorMode Of(std::string_view rig) const;  // kOff, where nobody has set one
  // Rigs that are monitored.
  std::map<std::string, MonitorMode> All() const;
  // Durable when it returns. Errors of the disk: nothing has changed.
  absl::Status Set(const std::string& rig, MonitorMode mode);

 private:
  explicit MonitorSettings(std::filesystem::path file) : file_(std::move(file)) {}
  absl::Status Read();

  const std::filesystem::path file_;
  mutable std::mutex mutex_;
  std::map<std::string, MonitorMode, std::less<>> modes_;  // without those that are off
};

}  // namespace rigcal::server

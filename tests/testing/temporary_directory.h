// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string_view>

namespace rigcal::testing {

// A new folder that is removed with everything in it at the end of the test.
class TemporaryDirectory {
 public:
  TemporaryDirectory();
  // In this folder instead of the system's.
  explicit TemporaryDirectory(const std::filesystem::path& parent);
  ~TemporaryDirectory();
  TemporaryDirectory(const TemporaryDirectory&) = delete;
  TemporaryDirectory& operator=(const TemporaryDirectory&) = delete;

  const std::filesystem::path& path() const { return path_; }
  // Writes a file with this text; returns its path.
  std::filesystem::path WriteFile(std::string_view name, std::string_view text) const;

 private:
  std::filesystem::path path_;
};

}  // namespace rigcal::testing

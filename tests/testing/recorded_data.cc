// SPDX-License-Identifier: Apache-2.0
#include "tests/testing/recorded_data.h"

#include <cstdlib>
#include <string_view>

namespace rigcal::testing {

std::optional<std::filesystem::path> RecordedDataDirectory() {
  std::filesystem::path directory =
      std::filesystem::path(RIGCAL_SOURCE_DIR).parent_path() / "shared" / "data";
  if (const char* given = std::getenv("RIGCAL_TEST_DATA")) directory = given;
  std::error_code error;
  if (!std::filesystem::is_directory(directory, error)) return std::nullopt;
  return directory;
}

bool RunsInCi() {
  const char* ci = std::getenv("CI");
  return ci != nullptr && std::string_view(ci) == "true";
}

}  // namespace rigcal::testing

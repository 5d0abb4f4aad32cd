// SPDX-License-Identifier: Apache-2.0
// Each library that CMake finds has one row in ARCHITECTURE.md.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <regex>
#include <string>
#include <vector>

namespace rigcal::testing::dependencies_test {
namespace {

using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::UnorderedElementsAreArray;

// All first groups of what `pattern` matches in the lines of a file that `inside` matches.
std::vector<std::string> MatchesIn(const std::string& file, const std::regex& inside,
                                   const std::regex& pattern) {
  std::ifstream stream(std::filesystem::path(RIGCAL_SOURCE_DIR) / file);
  std::vector<std::string> found;
  for (std::string line; std::getline(stream, line);) {
    std::smatch part;
    if (!std::regex_search(line, part, inside)) continue;
    const std::string text = part[1];
    for (std::sregex_iterator i(text.begin(), text.end(), pattern), end; i != end; ++i) {
      found.push_back((*i)[1]);
    }
  }
  return found;
}

TEST(Dependencies, EachHasOneRowInTheArchitecture) {
  const std::vector<std::string> found =
      MatchesIn("cmake/RigcalDependencies.cmake",
                std::regex(R"(^\s*((?:find_package|pkg_check_modules)\(.*))"),
                std::regex(R"(\(([A-Za-z0-9_-]+))"));
  // Rows of four columns that begin with names in backquotes; files and folders have a dot or
  // slash.
  const std::vector<std::string> documented =
      MatchesIn("ARCHITECTURE.md",
                std::regex(R"(^\| ((?:`[A-Za-z0-9_-]+`(?:, )?)+) \|[^|]*\|[^|]*\|[^|]*\|$)"),
                std::regex(R"(`([^`]+)`)"));
  ASSERT_THAT(found, Not(IsEmpty()));
  EXPECT_THAT(documented, UnorderedElementsAreArray(found));
}

}  // namespace
}  // namespace rigcal::testing::dependencies_test

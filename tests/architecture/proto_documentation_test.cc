// SPDX-License-Identifier: Apache-2.0
// Every message, field, value and RPC of the wire says what it means, in the line above it.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <regex>
#include <string>

namespace rigcal::testing::proto_documentation_test {
namespace {

namespace fs = std::filesystem;

// The text of `line` without the spaces in front.
std::string Trimmed(const std::string& line) {
  const size_t begin = line.find_first_not_of(' ');
  return begin == std::string::npos ? "" : line.substr(begin);
}

TEST(ProtoDocumentation, EverythingSaysWhatItMeans) {
  const std::regex needs_words(
      R"(^((repeated |optional )?[A-Za-z][\w.]* \w+ = \d+;|[A-Z][A-Z0-9_]+ = \d+;|(message|enum|rpc|service) \w+))");
  int items = 0;
  for (const auto& entry :
       fs::recursive_directory_iterator(fs::path(RIGCAL_SOURCE_DIR) / "proto")) {
    if (entry.path().extension() != ".proto") continue;
    std::ifstream stream(entry.path());
    std::string previous;
    int number = 0;
    for (std::string line; std::getline(stream, line); previous = Trimmed(line)) {
      ++number;
      if (!std::regex_search(Trimmed(line), needs_words)) continue;
      ++items;
      EXPECT_EQ(previous.substr(0, 2), "//")
          << entry.path().filename().string() << ":" << number << ": " << line;
    }
  }
  EXPECT_GT(items, 200) << "the protos were not found";
}

}  // namespace
}  // namespace rigcal::testing::proto_documentation_test

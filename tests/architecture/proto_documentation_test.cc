// SPDX-License-Identifier: Apache-2.0
// Every message, field, value and RPC of the wire says what it means, in the line above it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <istream>
#include <regex>
#include <sstream>
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

// "NOT_FOUND            no such session": a line of a table of status codes, with where its text
// begins. 0: it is none.
size_t TextColumn(const std::string& line) {
  static const std::regex kEntry(
      "^( *//( *)(CANCELLED|UNKNOWN|INVALID_ARGUMENT|DEADLINE_EXCEEDED|NOT_FOUND|ALREADY_EXISTS|"
      "PERMISSION_DENIED|RESOURCE_EXHAUSTED|FAILED_PRECONDITION|ABORTED|OUT_OF_RANGE|UNIMPLEMENTED|"
      "INTERNAL|UNAVAILABLE|DATA_LOSS|UNAUTHENTICATED) {2,})[^ ]");
  std::smatch match;
  return std::regex_search(line, match, kEntry) ? match[1].str().size() : 0;
}

// What is wrong with the tables of status codes in the comments of a file; empty: nothing. A
// formatter that joins their lines makes nonsense of them.
std::string FaultsOfTables(std::istream& stream) {
  static const std::regex kInside("^ *//.*[^ ].* ([A-Z]+_)*[A-Z]{5,} {2,}[^ ]");
  std::string faults;
  size_t column = 0;  // of the table that the line before belongs to
  int number = 0;
  for (std::string line; std::getline(stream, line);) {
    ++number;
    const auto note = [&](const char* what) {
      faults += std::to_string(number) + ": " + what + ": " + line + "\n";
    };
    const size_t begins = TextColumn(line);
    if (begins == 0 && std::regex_search(line, kInside)) note("a code inside of a line");
    if (begins > 0) {
      if (column > 0 && begins != column) note("not below the entry before it");
      column = begins;
    } else if (Trimmed(line) == "//" || Trimmed(line).substr(0, 2) != "//") {
      column = 0;
    } else if (column > 0 && line.find_first_not_of(" /") != column) {
      note("neither an entry nor the rest of one");
    }
  }
  return faults;
}

TEST(ProtoDocumentation, TablesOfStatusCodesAreTables) {
  int tables = 0;
  for (const auto& entry :
       fs::recursive_directory_iterator(fs::path(RIGCAL_SOURCE_DIR) / "proto")) {
    if (entry.path().extension() != ".proto") continue;
    std::ifstream stream(entry.path());
    EXPECT_EQ(FaultsOfTables(stream), "") << entry.path().filename().string();
    std::ifstream again(entry.path());
    for (std::string line; std::getline(again, line);) tables += TextColumn(line) > 0 ? 1 : 0;
  }
  EXPECT_GT(tables, 10) << "the tables were not found";
}

TEST(ProtoDocumentation, SeesATableThatWasReflowed) {
  std::istringstream good(
      "  // INVALID_ARGUMENT   a violation\n"
      "  // PERMISSION_DENIED  the caller is not\n"
      "  //                    it\n"
      "  // NOT_FOUND          no such session\n"
      "  rpc UploadBatch\n");
  EXPECT_EQ(FaultsOfTables(good), "");
  std::istringstream joined(
      "  // PERMISSION_DENIED  the caller is not\n"
      "  // it NOT_FOUND          no such session\n");
  EXPECT_THAT(FaultsOfTables(joined), ::testing::HasSubstr("inside of a line"));
  std::istringstream moved(
      "  // PERMISSION_DENIED  the caller is not\n"
      "  // it, whoever that may be\n");
  EXPECT_THAT(FaultsOfTables(moved), ::testing::HasSubstr("neither an entry"));
}

}  // namespace
}  // namespace rigcal::testing::proto_documentation_test

// SPDX-License-Identifier: Apache-2.0
#include "common/text/line_reader.h"

#include <sys/stat.h>

#include <string>
#include <vector>

#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::line_reader_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::_;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class LineReaderTest : public ::testing::Test {
 protected:
  std::vector<std::string> ReadAll(const std::string& text) {
    const std::string path = directory_.WriteFile("lines.txt", text).string();
    absl::StatusOr<LineReader> reader = LineReader::Open(path);
    EXPECT_THAT(reader, IsOk());
    std::vector<std::string> lines;
    while (reader.ok()) {
      const auto line = reader->Next();
      EXPECT_THAT(line, IsOk());
      if (!line.ok() || !line->has_value()) break;
      EXPECT_EQ((*line)->number, lines.size() + 1);
      lines.push_back((*line)->too_long ? "TOO LONG" : std::string((*line)->text));
    }
    return lines;
  }

  TemporaryDirectory directory_;
};

TEST_F(LineReaderTest, ReadsLfAndCrlfAndALastLineWithoutEnd) {
  EXPECT_THAT(ReadAll("a\r\nb\n\n c \nd"), ElementsAre("a", "b", "", " c ", "d"));
  EXPECT_THAT(ReadAll("a\n"), ElementsAre("a"));
  EXPECT_THAT(ReadAll(""), ElementsAre());
}

TEST_F(LineReaderTest, SkipsAByteOrderMarkAtTheBeginningOnly) {
  EXPECT_THAT(ReadAll("\xEF\xBB\xBF"
                      "1;2\n\xEF\xBB\xBF"
                      "3\n"),
              ElementsAre("1;2",
                          "\xEF\xBB\xBF"
                          "3"));
}

TEST_F(LineReaderTest, MarksALineThatIsTooLongAndGoesOnAfterIt) {
  const std::string longest(LineReader::kMaxLineBytes, 'x');
  EXPECT_THAT(ReadAll(longest + "\r\n" + longest + "x\n" + std::string(1'000'000, 'y') + "\nb\n"),
              ElementsAre(longest, "TOO LONG", "TOO LONG", "b"));
}

TEST_F(LineReaderTest, KeepsLinesThatCrossTheBuffersEdge) {
  std::string text;
  std::vector<std::string> expected;
  for (int i = 0; i < 20'000; ++i) {
    expected.push_back("line " + std::to_string(i * 7919));
    text += expected.back() + "\r\n";
  }
  EXPECT_EQ(ReadAll(text), expected);
}

TEST_F(LineReaderTest, RefusesWhatIsNoFile) {
  EXPECT_THAT(LineReader::Open((directory_.path() / "missing").string()),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("missing")));
  EXPECT_THAT(LineReader::Open(directory_.path().string()),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("not a regular file")));
  const std::string pipe = (directory_.path() / "pipe").string();
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_THAT(LineReader::Open(pipe), StatusIs(absl::StatusCode::kFailedPrecondition, _));
}

}  // namespace
}  // namespace rigcal::agent::line_reader_test

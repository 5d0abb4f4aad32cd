// SPDX-License-Identifier: Apache-2.0
#include <string>
#include <vector>

#include "common/camera/intrinsics_file.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::single_yaml_document_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(SingleDocument, KeepsEveryFieldOnItsLine) {
  ASSERT_OK_AND_ASSIGN(
      const std::string document,
      SingleDocument("f", "%YAML 1.0\r\n---\r\n# why\r\n\r\na: 1  \r\nb:\r\n  - 2"));
  EXPECT_EQ(document, "%YAML:1.0\n\n\n\na: 1\nb:\n  - 2\n");
}

TEST(SingleDocument, EndsAtTheEndOfTheDocument) {
  ASSERT_OK_AND_ASSIGN(const std::string document,
                       SingleDocument("f", "%YAML:1.0\na: 1\n...\n%%\n"));
  EXPECT_EQ(document, "%YAML:1.0\na: 1\n");
}

TEST(SingleDocument, NamesFileAndLineOfWhatIsNoField) {
  for (const std::string& row :
       std::vector<std::string>{"---", "----", "- 1", "%YAML:1.0", "]", "\xc9", "  --x", "  \xc9",
                                "....", "&a", "\"a\": 1", "a:\t1"}) {
    EXPECT_THAT(SingleDocument("left.yaml", "%YAML:1.0\na: 1\n" + row + "\n"),
                StatusIs(absl::StatusCode::kInvalidArgument,
                         AllOf(HasSubstr("left.yaml"), HasSubstr("line 3"))))
        << row;
  }
  EXPECT_THAT(SingleDocument("left.yaml", "%YAML:1.0\n  a: 1\n"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("line 2")));
}

}  // namespace
}  // namespace rigcal::single_yaml_document_test

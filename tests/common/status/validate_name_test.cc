// SPDX-License-Identifier: Apache-2.0
#include "common/status/validate_name.h"

#include "tests/testing/status_matchers.h"

namespace rigcal::validate_name_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(ValidateName, TakesLettersDigitsAndThreeSigns) {
  for (const char* name : {"a", "frame_0", "left-2", "Cam.03", "Z9"}) {
    EXPECT_THAT(ValidateName("camera name", name), IsOk()) << name;
  }
  EXPECT_THAT(ValidateName("camera name", std::string(64, 'x')), IsOk());
}

TEST(ValidateName, RefusesWhatCouldHarmAPathOrATable) {
  for (const std::string& name :
       {std::string(), std::string("."), std::string(".."), std::string(".hidden"),
        std::string("a/b"), std::string("a b"), std::string("a\nb"), std::string("caf\xc3\xa9"),
        std::string("a\0b", 3), std::string(65, 'x')}) {
    EXPECT_THAT(ValidateName("camera name", name),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("camera name")))
        << name;
  }
}

TEST(ValidateName, ShowsOnlySafeAndShortTextOfTheName) {
  const absl::Status status = ValidateName("session", std::string(100000, '\x01'));
  EXPECT_THAT(std::string(status.message()), AllOf(HasSubstr("\\x01"), Not(HasSubstr("\x01"))));
  EXPECT_LT(status.message().size(), 1000u);
}

}  // namespace
}  // namespace rigcal::validate_name_test

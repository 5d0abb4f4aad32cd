// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>
#include <string>

#include "common/discovery/join_found_server.h"
#include "tests/common/discovery/fake_discovery.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::ask_for_join_string_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class AskForJoinString : public ::testing::Test {
 protected:
  absl::StatusOr<std::string> Ask(const std::string& typed) {
    std::istringstream in(typed);
    return rigcal::AskForJoinString(&discovery_, {.out = out_, .in = &in});
  }

  FakeDiscovery discovery_;
  std::ostringstream out_;
};

TEST_F(AskForJoinString, ListsWhatIsFoundAndTakesWhatIsTyped) {
  discovery_.found = {{"hall", {"10.0.0.5", "fd00::5"}, 7420, 7421}, {"lab", {"10.0.0.6"}, 1, 2}};
  ASSERT_OK_AND_ASSIGN(const std::string text, Ask("  rk1.abc \nmore\n"));
  EXPECT_EQ(text, "rk1.abc");
  EXPECT_THAT(out_.str(), AllOf(HasSubstr("1  hall  10.0.0.5:7421, [fd00::5]:7421\n"),
                                HasSubstr("2  lab  10.0.0.6:2\n")));
}

TEST_F(AskForJoinString, ShowsNamesThatCannotForgeTheTerminal) {
  discovery_.found = {{"hall\n  9  bank\x1b[2J", {"10.0.0.5"}, 7420, 7421}};
  ASSERT_THAT(Ask("rk1.abc\n"), IsOk());
  EXPECT_THAT(out_.str(), AllOf(HasSubstr("hall\\n"), Not(HasSubstr("\x1b"))));
}

TEST_F(AskForJoinString, AsksAlsoWhereNothingIsFound) {
  EXPECT_THAT(Ask("rk1.abc\n"), IsOk());
  EXPECT_THAT(out_.str(), HasSubstr("mdns = true"));
  discovery_.found = absl::UnavailableError("no avahi-daemon");
  EXPECT_THAT(Ask("rk1.abc\n"), IsOk());
  EXPECT_THAT(out_.str(), HasSubstr("no avahi-daemon"));
}

TEST_F(AskForJoinString, SaysWhatToDoWhereNothingIsTyped) {
  for (const char* typed : {"", "\n", "  \n"}) {
    EXPECT_THAT(Ask(typed),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("rigcal token create")));
  }
  discovery_.found = {{"hall", {"10.0.0.5"}, 7420, 7421}};
  EXPECT_THAT(rigcal::AskForJoinString(&discovery_, {.out = out_}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("rigcal-agent join STRING")));
  EXPECT_THAT(out_.str(), HasSubstr("10.0.0.5:7421"));
}

}  // namespace
}  // namespace rigcal::testing::ask_for_join_string_test

// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/list_arguments.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "tests/testing/status_matchers.h"

namespace rigcal::testing::list_arguments_test {
namespace {

using server::FilterField;
using server::ListArguments;
using server::PageFiller;
using server::ParseFilter;
using server::ParseListArguments;
using server::RecordOrder;
using server::RecordPosition;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr FilterField kFilter[] = {{"rig"}, {"state"}, {.name = "ids", .repeated = true}};
constexpr server::ListFields kFields = {.filter = kFilter,
                                        .time_order = "create_time",
                                        .id_order = "id",
                                        .default_order = RecordOrder::kNewestFirst};

std::string Parsed(std::string_view text) {
  const auto terms = ParseFilter(text, kFilter);
  if (!terms.ok()) return std::string(terms.status().message());
  std::string joined;
  for (const ListArguments::Term& term : *terms) {
    joined += std::string(term.field) + "(" + term.value + ")";
  }
  return joined;
}

TEST(ParseFilter, ReadsTermsJoinedByAnd) {
  EXPECT_EQ(Parsed(""), "");
  EXPECT_EQ(Parsed("   "), "");
  EXPECT_EQ(Parsed("rig=lab-1"), "rig(lab-1)");
  EXPECT_EQ(Parsed(" rig = \"a b\"  AND ids : s-1 AND state=x"), "rig(a b)ids(s-1)state(x)");
  EXPECT_EQ(Parsed("rig=\"\""), "rig()");
}

TEST(ParseFilter, SaysWhereAndWhatIsWrong) {
  EXPECT_THAT(Parsed("rug=a"), AllOf(HasSubstr("'rug'"), HasSubstr("rig=VALUE, state=VALUE")));
  EXPECT_THAT(Parsed("rig"), HasSubstr("at character 4: '=' is expected after rig"));
  EXPECT_THAT(Parsed("rig:a"), HasSubstr("'=' is expected"));
  EXPECT_THAT(Parsed("ids=a"), HasSubstr("':' is expected"));
  EXPECT_THAT(Parsed("rig="), HasSubstr("a value is expected"));
  EXPECT_THAT(Parsed("rig=\"a"), HasSubstr("closing"));
  EXPECT_THAT(Parsed("rig=a state=b"), HasSubstr("AND is expected"));
  EXPECT_THAT(Parsed("rig=a AND"), HasSubstr("a field is expected"));
  EXPECT_THAT(Parsed("rig=a AND rig=b"), HasSubstr("given twice"));
  EXPECT_THAT(Parsed("rig=a;"), HasSubstr("AND is expected"));
  EXPECT_THAT(Parsed(std::string(2000, 'a')), HasSubstr("2000 bytes"));
}

TEST(ParseListArguments, KnowsItsOrdersAndPageSizes) {
  ASSERT_OK_AND_ASSIGN(const auto plain, ParseListArguments("", "", 0, "", kFields));
  EXPECT_EQ(plain.order, RecordOrder::kNewestFirst);
  EXPECT_EQ(plain.page_size, 100u);
  EXPECT_EQ(plain.Page().limit, 101);
  ASSERT_OK_AND_ASSIGN(const auto large, ParseListArguments("", "id desc", 5000, "", kFields));
  EXPECT_EQ(large.order, RecordOrder::kIdDescending);
  EXPECT_EQ(large.page_size, 1000u);
  EXPECT_THAT(ParseListArguments("", "size", 0, "", kFields),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("create_time or id")));
}

TEST(PageFiller, ATokenLeadsToTheNextPageOfTheSameListOnly) {
  ASSERT_OK_AND_ASSIGN(const auto list, ParseListArguments("rig=a", "id", 2, "", kFields));
  PageFiller page(list);
  page.Add({.time = 1, .id = "one"}, 10);
  EXPECT_FALSE(page.full());
  page.Add({.time = -7, .id = "two:with:colons"}, 10);
  EXPECT_TRUE(page.full());
  const std::string token = page.NextToken();
  ASSERT_OK_AND_ASSIGN(const auto next, ParseListArguments("rig = a", "id", 2, token, kFields));
  EXPECT_EQ(next.after, (RecordPosition{.time = -7, .id = "two:with:colons"}));
  for (const auto& other : {ParseListArguments("rig=b", "id", 2, token, kFields),
                            ParseListArguments("rig=a", "id desc", 2, token, kFields),
                            ParseListArguments("rig=a", "id", 2, "c-000001", kFields),
                            ParseListArguments("rig=a", "id", 2, token.substr(1), kFields)}) {
    EXPECT_THAT(other, StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("page_token")));
  }
}

TEST(PageFiller, APageEndsBeforeItsMessageIsTooLarge) {
  ASSERT_OK_AND_ASSIGN(const auto list, ParseListArguments("", "", 1000, "", kFields));
  PageFiller page(list);
  page.Add({.time = 1, .id = "one"}, 2u << 20);
  EXPECT_TRUE(page.full());
}

}  // namespace
}  // namespace rigcal::testing::list_arguments_test

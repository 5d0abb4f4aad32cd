// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/list_arguments.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "common/status/status_macros.h"
#include "rigcal/v1/agent_service.pb.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::list_arguments_test {
namespace {

using server::FillPage;
using server::FilterField;
using server::ListArguments;
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

// A page of agents whose messages have this many bytes of text.
struct Page {
  google::protobuf::RepeatedPtrField<v1::Agent> agents;
  std::string token;
};
absl::StatusOr<Page> PageOf(const ListArguments& list,
                            const std::vector<server::Listed<size_t>>& records) {
  Page page;
  RIGCAL_RETURN_IF_ERROR(FillPage(
      list, records,
      [](size_t bytes, v1::Agent* agent) {
        if (bytes == 0) return absl::NotFoundError("deleted");
        agent->set_host(std::string(bytes, 'x'));
        return absl::OkStatus();
      },
      &page.agents, &page.token));
  return page;
}

TEST(FillPage, ATokenLeadsToTheNextPageOfTheSameListOnly) {
  ASSERT_OK_AND_ASSIGN(const auto list, ParseListArguments("rig=a", "id", 2, "", kFields));
  ASSERT_OK_AND_ASSIGN(const Page page, PageOf(list, {{10, {.time = 1, .id = "one"}},
                                                      {10, {.time = -7, .id = "two:with:colons"}},
                                                      {10, {.time = 9, .id = "three"}}}));
  EXPECT_EQ(page.agents.size(), 2);
  const std::string token = page.token;
  ASSERT_OK_AND_ASSIGN(const auto next, ParseListArguments("rig = a", "id", 2, token, kFields));
  EXPECT_EQ(next.after, (RecordPosition{.time = -7, .id = "two:with:colons"}));
  for (const auto& other : {ParseListArguments("rig=b", "id", 2, token, kFields),
                            ParseListArguments("rig=a", "id desc", 2, token, kFields),
                            ParseListArguments("rig=a", "id", 2, "c-000001", kFields),
                            ParseListArguments("rig=a", "id", 2, token.substr(1), kFields)}) {
    EXPECT_THAT(other, StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("page_token")));
  }
}

TEST(FillPage, APageEndsBeforeItsMessageIsTooLarge) {
  ASSERT_OK_AND_ASSIGN(const auto list, ParseListArguments("", "", 1000, "", kFields));
  ASSERT_OK_AND_ASSIGN(const Page page, PageOf(list, {{2u << 20, {.time = 2, .id = "two"}},
                                                      {10, {.time = 1, .id = "one"}}}));
  EXPECT_EQ(page.agents.size(), 1);
  EXPECT_NE(page.token, "");
}

TEST(FillPage, LeavesOutWhatWasDeletedMeanwhile) {
  ASSERT_OK_AND_ASSIGN(const auto list, ParseListArguments("", "", 2, "", kFields));
  ASSERT_OK_AND_ASSIGN(const Page page, PageOf(list, {{0, {.time = 2, .id = "two"}},
                                                      {10, {.time = 1, .id = "one"}}}));
  EXPECT_EQ(page.agents.size(), 1);
  EXPECT_EQ(page.token, "");
}

}  // namespace
}  // namespace rigcal::testing::list_arguments_test

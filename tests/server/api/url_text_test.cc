// SPDX-License-Identifier: Apache-2.0
#include "server/api/url_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "tests/testing/status_matchers.h"

namespace rigcal::testing::url_text_test {
namespace {

using server::DecodeUrlText;
using server::ParseUrlQuery;
using server::UrlParameter;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(UrlText, DecodesWhatIsEncoded) {
  EXPECT_EQ(DecodeUrlText("a%20b+c%2b", false), "a b+c+");
  EXPECT_EQ(DecodeUrlText("a%20b+c%2B", true), "a b c+");
  EXPECT_EQ(DecodeUrlText("%C3%A4", false), "\xC3\xA4");
  EXPECT_EQ(DecodeUrlText("", false), "");
}

TEST(UrlText, RefusesHalvesControlCharactersAndWhatIsNoUtf8) {
  for (const char* bad : {"%", "%2", "a%", "%g0", "%0a", "%00", "a\nb", "%7f", "%ff", "a\xc3"}) {
    EXPECT_FALSE(DecodeUrlText(bad, true).has_value()) << bad;
  }
}

TEST(UrlText, TakesAQueryApart) {
  EXPECT_THAT(*ParseUrlQuery("a=1&b=x%20y&c&d=p=q&&"),
              ElementsAre(UrlParameter{"a", "1"}, UrlParameter{"b", "x y"}, UrlParameter{"c", ""},
                          UrlParameter{"d", "p=q"}));
  EXPECT_THAT(*ParseUrlQuery(""), IsEmpty());
}

TEST(UrlText, RefusesABadQuery) {
  EXPECT_THAT(ParseUrlQuery("a=1&a=2"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("'a' is given twice")));
  EXPECT_THAT(ParseUrlQuery("a=%zz"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("percent")));
  std::string many;
  for (int i = 0; i < 65; ++i) many += "n" + std::to_string(i) + "=&";
  EXPECT_THAT(ParseUrlQuery(many), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("64")));
}

}  // namespace
}  // namespace rigcal::testing::url_text_test

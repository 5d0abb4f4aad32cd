// SPDX-License-Identifier: Apache-2.0
#include "server/api/gzip.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "tests/testing/status_matchers.h"

namespace rigcal::testing::gzip_test {
namespace {

using server::Gunzipped;
using server::Gzipped;

TEST(Gzip, ComesBackAsItWas) {
  for (const std::string& text :
       {std::string(), std::string("a"), std::string(300'000, 'x'), std::string("\0\xff\n", 3)}) {
    for (const int level : {1, 9}) {
      const std::string bytes = Gzipped(text, level);
      EXPECT_EQ(bytes.substr(0, 2), "\x1f\x8b");
      EXPECT_EQ(*Gunzipped(bytes, 1 << 20), text);
    }
  }
  EXPECT_LT(Gzipped(std::string(300'000, 'x'), 1).size(), 5000u);
}

TEST(Gzip, RefusesDamageAndWhatIsTooLong) {
  const std::string bytes = Gzipped(std::string(300'000, 'x'), 9);
  EXPECT_THAT(Gunzipped(bytes, 1000), StatusIs(absl::StatusCode::kDataLoss, ::testing::_));
  EXPECT_THAT(Gunzipped(bytes.substr(0, bytes.size() - 1), 1 << 20),
              StatusIs(absl::StatusCode::kDataLoss, ::testing::_));
  EXPECT_THAT(Gunzipped("no gzip", 1 << 20), StatusIs(absl::StatusCode::kDataLoss, ::testing::_));
}

}  // namespace
}  // namespace rigcal::testing::gzip_test

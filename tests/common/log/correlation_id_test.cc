// SPDX-License-Identifier: Apache-2.0
#include "common/log/correlation_id.h"

#include <gtest/gtest.h>

namespace rigcal::correlation_id_test {
namespace {

TEST(CorrelationId, IsNewEachTime) {
  EXPECT_TRUE(IsCorrelationId(NewCorrelationId()));
  EXPECT_EQ(NewCorrelationId().size(), 16u);
  EXPECT_NE(NewCorrelationId(), NewCorrelationId());
  EXPECT_EQ(OwnCorrelationId(), OwnCorrelationId());
}

TEST(CorrelationId, HoldsNothingThatCouldForgeALine) {
  EXPECT_TRUE(IsCorrelationId("night-run_7.2"));
  EXPECT_TRUE(IsCorrelationId(std::string(64, 'a')));
  for (const std::string bad : {"", "a b", "a\nb", "a\"", "a=b", "\xff", "a)"}) {
    EXPECT_FALSE(IsCorrelationId(bad)) << bad;
  }
  EXPECT_FALSE(IsCorrelationId(std::string(65, 'a')));
}

}  // namespace
}  // namespace rigcal::correlation_id_test

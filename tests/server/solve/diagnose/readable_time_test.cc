// SPDX-License-Identifier: Apache-2.0
#include "server/solve/diagnose/readable_time.h"

#include <gtest/gtest.h>

namespace rigcal::server::readable_time_test {
namespace {

TEST(ReadableTime, HasTheUnitOfItsSize) {
  EXPECT_EQ(FormatTime(-0.00805), "8.05 ms");
  EXPECT_EQ(FormatTime(12.5), "12.50 s");
  EXPECT_EQ(FormatTime(-900), "15.00 min");
  EXPECT_EQ(FormatTime(9000), "2.50 h");
  const ReadableTime time = ReadableTimeOf(-9000);
  EXPECT_EQ(time.value, -2.5);
  EXPECT_EQ(time.unit, "h");
}

}  // namespace
}  // namespace rigcal::server::readable_time_test

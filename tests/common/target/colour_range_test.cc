// SPDX-License-Identifier: Apache-2.0
#include "common/target/colour_range.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "tests/testing/status_matchers.h"

namespace rigcal::testing::colour_range_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(ColourRange, DefaultIsValid) { EXPECT_THAT(ColourRange{}.Validate(), IsOk()); }

TEST(ColourRange, NamesEveryFault) {
  ColourRange range;
  range.hue_min_deg = -1;
  range.saturation_min = std::numeric_limits<double>::quiet_NaN();
  range.value_min = 0;
  const absl::Status status = range.Validate();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(
      std::string(status.message()),
      AllOf(HasSubstr("hue_min is -1"), HasSubstr("saturation_min"), HasSubstr("value_min is 0")));
}

}  // namespace
}  // namespace rigcal::testing::colour_range_test

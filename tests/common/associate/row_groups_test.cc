// SPDX-License-Identifier: Apache-2.0
#include "common/associate/row_groups.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace rigcal {
namespace {

// Rows every `period_ms` from `first_ms` on.
RowTimes Camera(const char* name, int64_t first_ms, int64_t period_ms, int count) {
  RowTimes rows{name, 1e-3 * static_cast<double>(period_ms), {}, {}};
  for (int i = 0; i < count; ++i) {
    rows.time_ns.push_back((first_ms + i * period_ms) * 1'000'000);
    rows.row.push_back(10 + i);
  }
  return rows;
}

TEST(GroupRows, TakesRowsOfOneMomentTogetherByTheirOwnNumbers) {
  const RowGrouping grouping = GroupRows({Camera("a", 0, 40, 3), Camera("b", 41, 40, 2)}, 0);
  ASSERT_EQ(grouping.groups.size(), 3u);
  EXPECT_EQ(grouping.groups[0].size(), 1u);
  ASSERT_EQ(grouping.groups[1].size(), 2u);
  EXPECT_EQ(grouping.groups[1][0].row, 11);
  EXPECT_EQ(grouping.groups[1][1].row, 10);
  EXPECT_EQ(MeanTimeNs(grouping.groups[1]), 40'500'000);
}

TEST(GroupRows, CamerasThatRunFreelyShareAPeriod) {
  const RowGrouping grouping = GroupRows({Camera("a", 0, 40, 10), Camera("b", 19, 40, 10)}, 0);
  for (const RowGroup& group : grouping.groups) EXPECT_EQ(group.size(), 2u);
}

TEST(GroupRows, WithoutRowsThereIsNothing) {
  EXPECT_THAT(GroupRows({Camera("a", 0, 40, 0)}, 0).groups, testing::IsEmpty());
}

}  // namespace
}  // namespace rigcal

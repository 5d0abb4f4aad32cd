// SPDX-License-Identifier: Apache-2.0
#include "server/listen/descriptor_limit.h"

#include <gtest/gtest.h>

namespace rigcal::testing::descriptor_limit_test {
namespace {

TEST(DescriptorLimit, ConnectionsLeaveRoomForTheRest) {
  EXPECT_EQ(server::ConnectionsWithin(1024, 1024), 384u);
  EXPECT_EQ(server::ConnectionsWithin(1u << 20, 1024), 1024u);
  EXPECT_EQ(server::ConnectionsWithin(64, 1024), 16u);
  EXPECT_EQ(server::ConnectionsWithin(0, 1024), 1u);
  EXPECT_EQ(server::ConnectionsWithin(1024, 0), 1u);
}

TEST(DescriptorLimit, IsRaised) {
  const size_t raised = server::RaiseDescriptorLimit();
  EXPECT_GE(raised, 1024u);
  EXPECT_EQ(server::RaiseDescriptorLimit(), raised);
}

}  // namespace
}  // namespace rigcal::testing::descriptor_limit_test

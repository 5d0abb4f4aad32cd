// SPDX-License-Identifier: Apache-2.0
#include "common/wire/spool_wire.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "common/wire/observation_wire.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::wire::spool_wire_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;
using ::testing::SizeIs;

TEST(SpoolWire, GivesAReportBackWithinThatOfItsStream) {
  CameraReport report;
  report.stream = {"s-1", "left", 3};
  report.spool = SpoolReport{.last_seq = 9,
                             .acknowledged_seq = 4,
                             .spooled_count = 3,
                             .dropped = {{"", RefusalReason::kSpoolFull, 2, ""}},
                             .end_is_unknown = true};
  ASSERT_OK_AND_ASSIGN(const CameraReport back, FromProto(ToProto(report)));
  EXPECT_EQ(back.spool, report.spool);
  ASSERT_OK_AND_ASSIGN(const CameraReport without, FromProto([&] {
                         v1::CameraReport proto = ToProto(report);
                         proto.clear_spool();
                         return proto;
                       }()));
  EXPECT_FALSE(without.spool);
}

TEST(SpoolWire, GivesAStatusBack) {
  const SpoolStatus status{.row_count = 1,
                           .bytes = 2,
                           .limit_bytes = 3,
                           .dropped = {{"", RefusalReason::kSpoolDamaged, 4, ""}},
                           .folder = "/f",
                           .problem = "the spool is full"};
  ASSERT_OK_AND_ASSIGN(const SpoolStatus back, FromProto(ToProto(status), "spool"));
  EXPECT_EQ(back, status);
}

TEST(SpoolWire, BoundsWhatAnAgentSays) {
  v1::SpoolStatus proto;
  proto.set_row_count(UINT64_MAX);
  proto.set_problem(std::string(100'000, 'x'));
  ASSERT_OK_AND_ASSIGN(const SpoolStatus status, FromProto(proto, "spool"));
  EXPECT_LT(status.row_count, uint64_t{1} << 60);
  EXPECT_LT(status.problem.size(), 2000u);
  for (int i = 0; i < 1000; ++i) proto.add_dropped()->set_count(1);
  EXPECT_THAT(FromProto(proto, "spool"), StatusIs(absl::StatusCode::kInvalidArgument,
                                                  HasSubstr("spool.dropped: 1000 reasons")));
  // The same reason twice is one, and one that is not known here stays.
  proto.clear_dropped();
  for (const int reason : {54, 54, 9999}) {
    proto.add_dropped()->set_reason(static_cast<v1::RefusalReason>(reason));
    proto.mutable_dropped()->rbegin()->set_count(3);
  }
  ASSERT_OK_AND_ASSIGN(const SpoolStatus merged, FromProto(proto, "spool"));
  EXPECT_THAT(merged.dropped, SizeIs(2));
}

}  // namespace
}  // namespace rigcal::wire::spool_wire_test

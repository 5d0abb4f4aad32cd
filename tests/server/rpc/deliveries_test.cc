// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/deliveries.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/wire/observation_wire.h"
#include "tests/server/rpc/test_agent.h"
#include "tests/server/session/session_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::deliveries_test {
namespace {

using server::ParseDelivery;
using ::testing::HasSubstr;

const StreamKey kLeft{"wave", "left", 1};

TEST(ParseDelivery, KnowsItsStream) {
  v1::ObservationBatch batch;
  wire::ToProto(MakeBatch(kLeft, 5, 8), &batch);
  ASSERT_OK_AND_ASSIGN(const server::Delivery rows, ParseDelivery(batch, 4));
  EXPECT_EQ(rows.stream(), kLeft);
  EXPECT_EQ(rows.batch.rows(), 4u);
  EXPECT_THAT(ParseDelivery(batch, 3),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("batch.time_ns")));
  ASSERT_OK_AND_ASSIGN(const server::Delivery end,
                       ParseDelivery(EndMessage(kLeft, 8).end_of_capture()));
  EXPECT_EQ(end.stream(), kLeft);
  EXPECT_EQ(end.last_seq, 8u);
  EXPECT_EQ(end.batch.rows(), 0u);
  v1::CameraReport report;
  EXPECT_THAT(ParseDelivery(report),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("session_id")));
}

TEST(ParseDelivery, AnUploadIsOfOneStream) {
  v1::UploadBatchRequest request;
  EXPECT_THAT(ParseDelivery(request, 10),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("neither")));
  wire::ToProto(MakeBatch(kLeft, 1, 3), request.mutable_batch());
  *request.mutable_end_of_capture() = EndMessage({"wave", "right", 1}, 3).end_of_capture();
  EXPECT_THAT(ParseDelivery(request, 10),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("end_of_capture")));
  *request.mutable_end_of_capture() = EndMessage(kLeft, 3).end_of_capture();
  ASSERT_OK_AND_ASSIGN(const server::Delivery both, ParseDelivery(request, 10));
  EXPECT_EQ(both.batch.rows(), 3u);
  EXPECT_EQ(both.last_seq, 3u);
}

}  // namespace
}  // namespace rigcal::testing::deliveries_test

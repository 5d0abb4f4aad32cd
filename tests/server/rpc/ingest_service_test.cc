// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/ingest_service.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "common/wire/grpc_status.h"
#include "common/wire/observation_wire.h"
#include "tests/server/rpc/rpc_fixture.h"
#include "tests/testing/process.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::ingest_service_test {
namespace {

using ::testing::HasSubstr;
using ::testing::SizeIs;

const StreamKey kLeft{"wave", "left", 1};

class IngestService : public RpcFixture {
 protected:
  absl::Status UploadRaw(const v1::UploadBatchRequest& request,
                         std::chrono::milliseconds limit = std::chrono::seconds(60)) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + limit);
    v1::UploadBatchResponse response;
    return wire::FromGrpc(
        v1::IngestService::NewStub(channel())->UploadBatch(&context, request, &response));
  }
};

TEST_F(IngestService, UploadReturnsWhenTheBatchIsDurable) {
  StartWave({"left"});
  ASSERT_OK_AND_ASSIGN(const v1::BatchAck ack, client().Upload(MakeBatch(kLeft, 1, 10)));
  EXPECT_EQ(ack.durable_seq(), 10u);
  EXPECT_THAT(ReadRows(store(), "wave"), SizeIs(10));
  ASSERT_OK_AND_ASSIGN(const v1::BatchAck again, client().Upload(MakeBatch(kLeft, 1, 10)));
  EXPECT_EQ(again.durable_seq(), 10u);
  ASSERT_OK_AND_ASSIGN(const v1::BatchAck end, client().UploadEnd("wave", "left", 1, 10));
  EXPECT_TRUE(end.complete());
  EXPECT_EQ(AwaitState("wave", v1::Session::STATE_FINISHED).observation_count(), 10u);
}

TEST_F(IngestService, UploadAfterTheEndIsStoredAsLate) {
  StartWave({"left"});
  ASSERT_THAT(client().UploadEnd("wave", "left", 1, 0), IsOk());
  AwaitState("wave", v1::Session::STATE_FINISHED);
  EXPECT_THAT(client().Upload(MakeBatch({"wave", "left", 2}, 1, 10)), IsOk());
  ASSERT_OK_AND_ASSIGN(const v1::Session session, client().GetSession("wave"));
  EXPECT_EQ(session.late_count(), 10u);
}

TEST_F(IngestService, UploadRefusesWhatItCannotPlace) {
  ASSERT_THAT(client().CreateSession(WaveRequest("fresh")), IsOk());
  StartWave({"left"});
  EXPECT_THAT(client().Upload(MakeBatch({"nobody", "left", 1}, 1, 2)),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("nobody")));
  EXPECT_THAT(client().Upload(MakeBatch({"wave", "top", 1}, 1, 2)),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("top")));
  EXPECT_THAT(client().Upload(MakeBatch({"fresh", "left", 1}, 1, 2)),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("fresh")));
  EXPECT_THAT(UploadRaw({}), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("batch")));
  v1::UploadBatchRequest request;
  wire::ToProto(MakeBatch(kLeft, 1, 2), request.mutable_batch());
  request.mutable_batch()->mutable_x_px()->RemoveLast();
  EXPECT_THAT(UploadRaw(request),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("batch.x_px")));
}

TEST_F(IngestService, UploadSaysWhenTheDiskIsFull) {
  StartWave({"left"});
  faulty().Fail("Append", absl::ResourceExhaustedError("disk full"));
  EXPECT_THAT(client().Upload(MakeBatch(kLeft, 1, 2)),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("disk full")));
}

TEST_F(IngestService, AnUploadThatTheClientGivesUpIsStillStoredOnce) {
  StartWave({"left"});
  std::atomic<bool> go = false;
  faulty().OnCall("Append", [&] {
    while (!go) std::this_thread::yield();
  });
  v1::UploadBatchRequest request;
  wire::ToProto(MakeBatch(kLeft, 1, 5), request.mutable_batch());
  EXPECT_EQ(UploadRaw(request, std::chrono::milliseconds(20)).code(),
            absl::StatusCode::kDeadlineExceeded);
  go = true;
  ASSERT_OK_AND_ASSIGN(const v1::BatchAck ack, client().Upload(MakeBatch(kLeft, 1, 5)));
  EXPECT_EQ(ack.durable_seq(), 5u);
  EXPECT_THAT(ReadRows(store(), "wave"), SizeIs(5));
}

TEST_F(IngestService, MessagesBeyondTheLimitAreRefused) {
  StartWave({"left"});
  v1::UploadBatchRequest request;
  wire::ToProto(MakeBatch(kLeft, 1, 2), request.mutable_batch());
  request.mutable_batch()->mutable_x_px()->Resize(2'000'000, 0);
  EXPECT_THAT(UploadRaw(request), StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("")));
}

TEST_F(IngestService, LimitsOpenStreams) {
  rpc_options_.agents.max_streams = 2;
  RestartServer();
  auto first = std::make_unique<TestAgent>(channel(), MakeHello("one", {"left"}));
  first->ReadHello();
  TestAgent second(channel(), MakeHello("two", {"right"}));
  second.ReadHello();
  TestAgent third(channel(), MakeHello("three", {"top"}));
  EXPECT_THAT(third.AwaitEnd(),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("2 agent streams")));
  EXPECT_THAT(first->Finish(), IsOk());
  uint32_t connection = 1;
  EXPECT_TRUE(WaitFor([&] {
    TestAgent fourth(channel(), MakeHello("four", {"left"}, 1, ++connection));
    return fourth.Read().has_value();
  }));
}

}  // namespace
}  // namespace rigcal::testing::ingest_service_test

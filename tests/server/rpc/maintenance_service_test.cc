// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <future>
#include <list>
#include <memory>
#include <stdexcept>
#include <thread>
#include <utility>

#include "common/wire/grpc_status.h"
#include "rigcal/v1/maintenance_service.grpc.pb.h"
#include "tests/server/rpc/rpc_fixture.h"
#include "tests/testing/process.h"
#include "tests/testing/reflection_client.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::maintenance_service_test {
namespace {

using ::testing::HasSubstr;

// A call of Compact.
struct Call {
  explicit Call(const std::shared_ptr<grpc::Channel>& channel) {
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
    reader = v1::MaintenanceService::NewStub(channel)->Compact(&context, {});
  }
  // Reads to the end.
  absl::Status End() {
    while (reader->Read(&last)) {
    }
    return wire::FromGrpc(reader->Finish());
  }

  grpc::ClientContext context;
  std::unique_ptr<grpc::ClientReader<v1::CompactResponse>> reader;
  v1::CompactResponse last;
};

class MaintenanceService : public RpcFixture {
 protected:
  // Until Release, compacting does not get on.
  void Hold() {
    faulty().OnCall("Compact", [released = released_.get_future().share()] { released.wait(); });
  }
  void Release() {
    if (!std::exchange(is_released_, true)) released_.set_value();
  }
  void TearDown() override {
    Release();
    RpcFixture::TearDown();
  }

  std::promise<void> released_;
  bool is_released_ = false;
};

TEST_F(MaintenanceService, TellsWhenTheDatabaseIsCompact) {
  for (int i = 0; i < 3; ++i) {
    Call call(channel());
    EXPECT_THAT(call.End(), IsOk());
    EXPECT_EQ(call.last.fraction(), 1);
    EXPECT_GT(call.last.size_bytes(), 0u);
  }
  EXPECT_EQ(faulty().CallCount("CompactEnd"), 3);
}

TEST_F(MaintenanceService, TakesNoThreadOfTheServer) {
  rpc_options_.endpoint.max_threads = 16;  // the fewest allowed
  RestartServer();
  Hold();
  Call first(channel());
  ASSERT_TRUE(first.reader->Read(&first.last));
  EXPECT_LT(first.last.fraction(), 1);
  std::list<Call> others;
  for (int i = 0; i < 64; ++i) others.emplace_back(channel());
  for (int i = 0; i < 3; ++i) EXPECT_THAT(client().ListAgents(), IsOk());
  for (Call& other : others) {
    EXPECT_THAT(other.End(), StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("already")));
  }
  Release();
  EXPECT_THAT(first.End(), IsOk());
  EXPECT_EQ(faulty().CallCount("Compact"), 1);
}

TEST_F(MaintenanceService, AClientThatReadsNothingKeepsNobodyWaiting) {
  std::list<Call> unread;
  unread.emplace_back(channel());
  EXPECT_TRUE(WaitFor([&] { return faulty().CallCount("CompactEnd") == 1; }));
  EXPECT_TRUE(WaitFor([&] { return Call(channel()).End().ok(); }));
}

TEST_F(MaintenanceService, ABadRequestStartsNothing) {
  EXPECT_THAT(CallRaw(channel(), "/rigcal.v1.MaintenanceService/Compact", "\xff"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("")));
  EXPECT_EQ(faulty().CallCount("Compact"), 0);
}

TEST_F(MaintenanceService, TellsWhatFailedAndCanBeAskedAgain) {
  faulty().Fail("Compact", absl::ResourceExhaustedError("it needs 12 MiB on the disk"));
  EXPECT_THAT(Call(channel()).End(),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("12 MiB")));
  faulty().Fail("Compact", absl::OkStatus());
  faulty().OnCall("Compact", [] { throw std::runtime_error("out of paper"); });
  EXPECT_THAT(Call(channel()).End(),
              StatusIs(absl::StatusCode::kInternal, HasSubstr("out of paper")));
  faulty().OnCall("Compact", [] {});
  EXPECT_THAT(Call(channel()).End(), IsOk());
}

TEST_F(MaintenanceService, StopsWhenTheClientLeaves) {
  faulty().OnCall("Compact", [] { std::this_thread::sleep_for(std::chrono::milliseconds(20)); });
  // The server may hear of it too late, when all is done.
  EXPECT_TRUE(WaitFor([&] {
    Call call(channel());
    call.reader->Read(&call.last);
    call.context.TryCancel();
    return !call.End().ok() && faulty().CallCount("CompactCancelled") > 0;
  }));
  EXPECT_TRUE(WaitFor([&] { return Call(channel()).End().ok(); }));
}

TEST_F(MaintenanceService, EndsWithTheServer) {
  Hold();
  Call call(channel());
  ASSERT_TRUE(call.reader->Read(&call.last));
  auto end = std::async(std::launch::async, [&] { return call.End(); });
  auto closed = std::async(std::launch::async, [&] { rpc_->Shutdown(std::chrono::seconds(30)); });
  EXPECT_THAT(end.get(), StatusIs(absl::StatusCode::kUnavailable, HasSubstr("")));
  Release();
  closed.get();
}

}  // namespace
}  // namespace rigcal::testing::maintenance_service_test

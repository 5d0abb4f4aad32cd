// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/observation_readers.h"

#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "common/wire/grpc_status.h"
#include "common/wire/observation_wire.h"
#include "tests/server/rpc/rpc_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::observation_readers_test {
namespace {

using std::chrono::milliseconds;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::SizeIs;
using SteadyClock = std::chrono::steady_clock;

constexpr uint32_t kRows = 120'000;  // far more than a connection takes unread

ObservationBatch Batch(size_t rows, size_t samples) {
  ObservationBatch batch = MakeBatch({"wave", "left", 1}, 1, static_cast<uint32_t>(rows));
  for (size_t i = 0; i < samples; ++i) {
    batch.clock_samples.push_back({.device_ns = static_cast<int64_t>(i)});
  }
  return batch;
}

TEST(CutToMessages, LeavesASmallBatchAsItIs) {
  const auto messages = server::CutToMessages(Batch(100, 10));
  ASSERT_THAT(messages, SizeIs(1));
  EXPECT_EQ(messages[0].rows(), 100u);
  EXPECT_THAT(messages[0].clock_samples, SizeIs(10));
  EXPECT_THAT(server::CutToMessages(Batch(0, 5)), SizeIs(1));
}

TEST(CutToMessages, KeepsEveryRowAndSampleInMessagesOfAMebibyte) {
  size_t rows = 0, samples = 0;
  for (const ObservationBatch& message : server::CutToMessages(Batch(50'000, 100'000))) {
    v1::ReadObservationsResponse response;
    wire::ToProto(message, response.mutable_batch());
    EXPECT_LT(response.ByteSizeLong(), size_t{2} << 20);
    if (message.rows() > 0) {
      EXPECT_EQ(message.first_seq, rows + 1);
    }
    for (const ClockSample& sample : message.clock_samples) {
      EXPECT_EQ(sample.device_ns, static_cast<int64_t>(samples++));
    }
    rows += message.rows();
  }
  EXPECT_EQ(rows, 50'000u);
  EXPECT_EQ(samples, 100'000u);
}

// One reading client.
struct Reader {
  grpc::ClientContext context;
  std::unique_ptr<grpc::ClientReader<v1::ReadObservationsResponse>> stream;

  explicit Reader(const std::shared_ptr<grpc::Channel>& channel) {
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(100));
    v1::ReadObservationsRequest request;
    request.set_session_id("wave");
    stream = v1::SessionService::NewStub(channel)->ReadObservations(&context, request);
  }
  // Rows up to the end.
  absl::StatusOr<size_t> ReadAll() {
    size_t rows = 0;
    v1::ReadObservationsResponse response;
    while (stream->Read(&response)) rows += static_cast<size_t>(response.batch().time_ns_size());
    const absl::Status status = wire::FromGrpc(stream->Finish());
    if (!status.ok()) return status;
    return rows;
  }
};

class ObservationReaders : public RpcFixture {
 protected:
  void Serve() {
    RestartServerOnPort();
    StartByHand("wave", {"left"});
    for (uint32_t first = 1; first < kRows; first += 6000) {
      Deliver({"wave", "left", 1}, first, first + 5999);
    }
  }
  // A connection of its own.
  std::shared_ptr<grpc::Channel> Connect() const {
    grpc::ChannelArguments arguments;
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    return grpc::CreateCustomChannel("127.0.0.1:" + std::to_string(port_),
                                     grpc::InsecureChannelCredentials(), arguments);
  }
  absl::Status GetStatus(const std::shared_ptr<grpc::Channel>& channel) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
    v1::GetStatusResponse response;
    return wire::FromGrpc(v1::StatusService::NewStub(channel)->GetStatus(&context, {}, &response));
  }
};

TEST_F(ObservationReaders, TwoHundredThatReadNothingHoldUpNobody) {
  Serve();
  std::vector<std::shared_ptr<grpc::Channel>> channels;
  std::vector<std::unique_ptr<Reader>> readers;
  for (int i = 0; i < 200; ++i) {
    if (i % 50 == 0) channels.push_back(Connect());
    readers.push_back(std::make_unique<Reader>(channels.back()));
  }
  const auto other = Connect();
  std::vector<double> seconds;
  for (int i = 0; i < 200; ++i) {
    const auto start = SteadyClock::now();
    ASSERT_THAT(GetStatus(other), IsOk());
    seconds.push_back(std::chrono::duration<double>(SteadyClock::now() - start).count());
  }
  std::sort(seconds.begin(), seconds.end());
  RecordProperty("p99_ms", static_cast<int>(1e3 * seconds[198]));
  EXPECT_LT(seconds[198], 1);
  int served = 0, refused = 0;
  for (const auto& reader : readers) {
    const auto rows = reader->ReadAll();
    if (rows.ok()) {
      EXPECT_EQ(*rows, kRows);
      ++served;
    } else {
      EXPECT_THAT(rows.status(),
                  StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("limits.max_readers")));
      ++refused;
    }
  }
  EXPECT_GE(served, 16);
  EXPECT_GT(refused, 0);
}

TEST_F(ObservationReaders, OneThatTakesNothingIsCutOffWithTheReason) {
  rpc_options_.readers = {.max_readers = 1, .stall_limit = milliseconds(400)};
  Serve();
  Reader stalled(Connect());
  const auto channel = Connect();
  // Its place is free once it has been cut off.
  absl::StatusOr<size_t> rows = absl::UnknownError("");
  const auto limit = SteadyClock::now() + std::chrono::seconds(60);
  while (!rows.ok() && SteadyClock::now() < limit) {
    std::this_thread::sleep_for(milliseconds(20));
    rows = Reader(channel).ReadAll();
  }
  ASSERT_THAT(rows, IsOk());
  EXPECT_EQ(*rows, kRows);
  EXPECT_THAT(stalled.ReadAll(),
              StatusIs(absl::StatusCode::kDeadlineExceeded,
                       AllOf(HasSubstr("took no observations"), HasSubstr("'wave'"))));
}

TEST_F(ObservationReaders, OneThatIsSlowIsServed) {
  rpc_options_.readers = {.max_readers = 1, .stall_limit = milliseconds(4000)};
  Serve();
  Reader slow(Connect());
  v1::ReadObservationsResponse response;
  for (int i = 0; i < 5; ++i) {
    std::this_thread::sleep_for(milliseconds(100));
    ASSERT_TRUE(slow.stream->Read(&response));
  }
  EXPECT_THAT(slow.ReadAll(), IsOk());
}

TEST_F(ObservationReaders, OneThatGoesMakesRoom) {
  rpc_options_.readers.max_readers = 1;
  Serve();
  {
    Reader gone(Connect());
    v1::ReadObservationsResponse response;
    ASSERT_TRUE(gone.stream->Read(&response));
    gone.context.TryCancel();
    (void)gone.ReadAll();
  }
  const auto channel = Connect();
  absl::StatusOr<size_t> rows = absl::UnknownError("");
  const auto limit = SteadyClock::now() + std::chrono::seconds(60);
  while (!rows.ok() && SteadyClock::now() < limit) rows = Reader(channel).ReadAll();
  EXPECT_THAT(rows, IsOk());
}

TEST_F(ObservationReaders, TheServerStopsWhileOneReadsNothing) {
  Serve();
  Reader unread(Connect());
  v1::ReadObservationsResponse response;
  ASSERT_TRUE(unread.stream->Read(&response));
  const auto start = SteadyClock::now();
  rpc_->Shutdown(std::chrono::seconds(60));
  EXPECT_LT(SteadyClock::now() - start, std::chrono::seconds(20));
  EXPECT_FALSE(unread.ReadAll().ok());
}

}  // namespace
}  // namespace rigcal::testing::observation_readers_test

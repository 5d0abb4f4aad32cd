// SPDX-License-Identifier: Apache-2.0
// What is sent when: credit, batches, acknowledgements, clocks and reports.
#include <grpcpp/grpcpp.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <memory>
#include <new>

#include "tests/agent/uplink/uplink_fixture.h"

namespace rigcal::agent::uplink_flow_test {
namespace {

using std::chrono::milliseconds;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

class UplinkFlow : public UplinkFixture {};

TEST_F(UplinkFlow, KeepsEverythingWhileNothingIsAcknowledged) {
  server_.Set([](FakeBehaviour& behaviour) { behaviour.acknowledges = false; });
  Start();
  server_.WaitForHello(1);
  server_.StartCapture("s-1", {"left"});
  left_->YieldRows(0, 100);
  left_->YieldEnd();
  server_.WaitFor([](const State& now) { return now.At(kLeft).end.has_value(); });
  server_.Disconnect(grpc::Status(grpc::StatusCode::UNAVAILABLE, "cable"));
  server_.WaitForHello(2);
  server_.WaitFor([](const State& now) {
    const auto& received = now.At(kLeft).times_received;
    return received.contains(100) && received.at(100) == 2;
  });
  EXPECT_TRUE(spool_.Find(kLeft).has_value());
  server_.AcknowledgeAll();
  ExpectRows(WaitForEnd(kLeft).At(kLeft), 100);
}

TEST_F(UplinkFlow, KeepsToItsCredit) {
  server_.Set([](FakeBehaviour& behaviour) { behaviour.window = 10; });
  Start();
  server_.WaitForHello(1);
  server_.StartCapture("s-1", {"left"});
  left_->YieldRows(0, 500);
  left_->YieldEnd();
  const State state = WaitForEnd(kLeft);
  ExpectRows(state.At(kLeft), 500);
  EXPECT_FALSE(state.At(kLeft).exceeded_credit);
}

TEST_F(UplinkFlow, SendsNoMoreThanItsCreditWithoutAcknowledgement) {
  server_.Set([](FakeBehaviour& behaviour) {
    behaviour.window = 10;
    behaviour.acknowledges = false;
  });
  UplinkOptions options = QuickOptions();
  options.ping_interval = milliseconds(2);
  Start(options);
  server_.WaitForHello(1);
  server_.StartCapture("s-1", {"left"});
  left_->YieldRows(0, 500);
  server_.WaitFor([](const State& now) { return now.At(kLeft).times_received.contains(10); });
  // The connection stays, with nothing but pings.
  const uint32_t pings = server_.Now().ping_count;
  const State state =
      server_.WaitFor([&](const State& now) { return now.ping_count >= pings + 5; });
  EXPECT_THAT(state.At(kLeft).time_of_seq, SizeIs(10));
}

TEST_F(UplinkFlow, KeepsToTheServersBatchLimit) {
  server_.Set([](FakeBehaviour& behaviour) { behaviour.max_batch_observations = 16; });
  Start();
  server_.WaitForHello(1);
  left_->YieldRows(0, 300);
  left_->YieldEnd();
  server_.StartCapture("s-1", {"left"});
  const State state = WaitForEnd(kLeft);
  ExpectRows(state.At(kLeft), 300);
  EXPECT_LE(state.At(kLeft).largest_batch, 16u);
}

TEST_F(UplinkFlow, DropsASessionTheServerNoLongerKnows) {
  server_.Set([](FakeBehaviour& behaviour) { behaviour.acknowledges = false; });
  Start();
  server_.WaitForHello(1);
  server_.StartCapture("s-1", {"left"});
  left_->YieldRows(0, 10);
  server_.WaitFor([](const State& now) { return now.At(kLeft).times_received.contains(10); });
  server_.Set([](FakeBehaviour& behaviour) {
    behaviour.acknowledges = true;
    behaviour.unknown_sessions = {"s-1"};
  });
  server_.Disconnect(grpc::Status(grpc::StatusCode::NOT_FOUND, "session s-1 was deleted"));
  EXPECT_EQ(server_.WaitForHello(2).pending_size(), 1);
  // The camera is free for the next session at once.
  server_.WaitFor([](const State& now) { return now.ping_count >= 2; });
  server_.StartCapture("s-2", {"left"});
  left_->WaitUntilStarted(2);
  left_->YieldRows(0, 3);
  left_->YieldEnd();
  const State state = WaitForEnd({"s-2", "left", 7});
  ExpectRows(state.At({"s-2", "left", 7}), 3);
  EXPECT_EQ(state.At(kLeft).times_received.at(10), 1u);
}

TEST_F(UplinkFlow, SendsAHostAlignmentAheadOfAClockThatNeedsIt) {
  Start(QuickOptions(), "");
  server_.WaitForHello(1);
  server_.StartCapture("s-1", {"left", "right"});
  left_->AddClockSample({10, 20, 30, 40});
  left_->YieldRows(0, 1);
  left_->YieldEnd();
  const State state = WaitForEnd(kLeft);
  ASSERT_THAT(state.At(kLeft).batches, SizeIs(1));
  const ObservationBatch& batch = state.At(kLeft).batches[0];
  EXPECT_THAT(batch.clock_samples, ElementsAre(ClockSample{10, 20, 30, 40}));
  ASSERT_THAT(batch.host_alignments, SizeIs(1));
  // The fake server's clock is this PC's.
  EXPECT_LE(std::abs(batch.host_alignments[0].server_minus_host_ns),
            batch.host_alignments[0].uncertainty_ns + 1'000'000);
}

TEST_F(UplinkFlow, DeliversWithoutAlignmentWhenPingsAreNotAnswered) {
  server_.Set([](FakeBehaviour& behaviour) { behaviour.answers_pings = false; });
  UplinkOptions options = QuickOptions();
  options.alignment_timeout = milliseconds(20);
  Start(options, "");
  server_.WaitForHello(1);
  server_.StartCapture("s-1", {"left"});
  left_->YieldRows(0, 1);
  left_->YieldEnd();
  EXPECT_THAT(WaitForEnd(kLeft).At(kLeft).batches.at(0).host_alignments, IsEmpty());
}

TEST_F(UplinkFlow, ReportsWhatASourceRefusesWhileItRuns) {
  UplinkOptions options = QuickOptions();
  options.report_interval = milliseconds(5);
  Start(options);
  server_.WaitForHello(1);
  left_->SetRefused({{"", RefusalReason::kCsvBadTime, 2, "f.csv:3: bad"}});
  server_.StartCapture("s-1", {"left"});
  int rows = 0;
  // The first ones may tell of the spool only.
  const auto has_refused = [&] {
    const auto report = server_.Now().At(kLeft).report;
    return report && !report->refused.empty();
  };
  while (!has_refused()) {
    left_->YieldRows(rows++, 1);
    server_.WaitFor(
        [&](const State& now) { return now.At(kLeft).durable_seq >= static_cast<uint32_t>(rows); });
  }
  EXPECT_THAT(server_.Now().At(kLeft).report->refused,
              ElementsAre(Refusal{"", RefusalReason::kCsvBadTime, 2, "f.csv:3: bad"}));
}

TEST_F(UplinkFlow, SurvivesWhatAConnectionThrows) {
  std::atomic<int> attempts = 0;
  Start(QuickOptions(), "recording",
        [&](const std::string&, bool) -> std::shared_ptr<grpc::Channel> {
          const int attempt = ++attempts;
          if (attempt == 1) throw std::bad_alloc();
          if (attempt == 2) throw 7;
          return server_.Channel();
        });
  server_.WaitForHello(1);
  server_.StartCapture("s-1", {"left"});
  left_->YieldRows(0, 100);
  left_->YieldEnd();
  ExpectRows(WaitForEnd(kLeft).At(kLeft), 100);
  EXPECT_EQ(attempts, 3);
}

TEST_F(UplinkFlow, ReportsWhereTheRowsOfItsStreamsAre) {
  UplinkOptions options = QuickOptions();
  options.report_interval = milliseconds(5);
  server_.Set([](FakeBehaviour& behaviour) { behaviour.acknowledges = false; });
  Start(options);
  server_.WaitForHello(1);
  server_.StartCapture("s-1", {"left"});
  left_->YieldRows(0, 9);
  const auto has = [](uint32_t acknowledged_seq, uint64_t spooled_count) {
    return [=](const State& now) {
      const auto& report = now.At(kLeft).report;
      return report && report->spool && report->spool->last_seq == 9 &&
             report->spool->acknowledged_seq == acknowledged_seq &&
             report->spool->spooled_count == spooled_count;
    };
  };
  server_.WaitFor(has(0, 9));
  server_.AcknowledgeAll();
  server_.WaitFor(has(9, 0));
}

}  // namespace
}  // namespace rigcal::agent::uplink_flow_test

// SPDX-License-Identifier: Apache-2.0
#include "server/ingest/ingest.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <future>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <new>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "tests/server/ingest/fake_store.h"
#include "tests/server/store/store_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::ingest_test {
namespace {

using ::rigcal::testing::EndDelivery;
using ::rigcal::testing::FakeStore;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::KeyOf;
using ::rigcal::testing::MakeBatch;
using ::rigcal::testing::StatusIs;
using ::testing::_;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Knows cameras "a" to "z" of every session; "s-created" has not started.
absl::StatusOr<StreamContext> ContextOf(const StreamKey& stream) {
  if (stream.camera.size() != 1) return absl::NotFoundError("no camera " + stream.camera);
  if (stream.session_id == "s-created") return absl::FailedPreconditionError("not started");
  return StreamContext{.image_size_px = {.width = 1280, .height = 1024}, .marker_count = 3};
}

Delivery MakeDelivery(const StreamKey& stream, uint32_t first_seq, uint32_t last_seq) {
  return {.batch = MakeBatch(stream, first_seq, last_seq)};
}

class IngestTest : public ::testing::Test {
 protected:
  void SetUp() override { Create({}); }
  void TearDown() override {
    store_.Release();
    if (ingest_ != nullptr) ingest_->Shutdown();
  }

  void Create(const IngestOptions& options) {
    ingest_ = std::make_unique<Ingest>(
        options, &store_, ContextOf,
        [this](const StreamKey& stream, const AppendOutcome& outcome) {
          if (throw_at_progress_.exchange(false)) throw std::bad_alloc();
          const std::lock_guard lock(mutex_);
          progress_.emplace_back(stream, outcome);
        },
        [this](const Delivery& delivery, const AppendOutcome& outcome) {
          if (throw_at_delivery_.exchange(false)) throw 7;
          const std::lock_guard lock(mutex_);
          delivered_.emplace_back(delivery.batch.rows(), outcome.stored_rows);
        });
  }

  absl::Status Submit(Delivery& delivery) {
    return ingest_->Submit(
        delivery,
        [this](absl::StatusOr<BatchAck> ack) {
          const std::lock_guard lock(mutex_);
          answers_.push_back(std::move(ack));
        },
        [this] { ++space_calls_; });
  }
  absl::Status Submit(Delivery&& delivery) { return Submit(delivery); }

  // Starts the writer and holds it in its first commit, with one delivery of camera "z" in it.
  void HoldFirstCommit() {
    store_.Hold();
    ASSERT_THAT(Submit(MakeDelivery(KeyOf("z"), 1, 1)), IsOk());
    ingest_->Start();
    store_.WaitUntilHeld();
  }

  std::vector<absl::StatusOr<BatchAck>> answers() {
    const std::lock_guard lock(mutex_);
    return answers_;
  }

  FakeStore store_;
  std::mutex mutex_;
  std::vector<absl::StatusOr<BatchAck>> answers_;
  std::vector<std::pair<StreamKey, AppendOutcome>> progress_;
  std::vector<std::pair<size_t, uint32_t>> delivered_;  // rows, and those that were new
  std::atomic<int> space_calls_ = 0;
  std::atomic<bool> throw_at_progress_ = false, throw_at_delivery_ = false;
  std::unique_ptr<Ingest> ingest_;
};

TEST_F(IngestTest, AcknowledgesWhatIsStored) {
  ingest_->Start();
  ASSERT_THAT(Submit(MakeDelivery(KeyOf("a", 4), 1, 16)), IsOk());
  ingest_->WaitIdle();
  ASSERT_EQ(answers().size(), 1u);
  ASSERT_THAT(answers()[0], IsOk());
  EXPECT_EQ(answers()[0]->stream, KeyOf("a", 4));
  EXPECT_EQ(answers()[0]->durable_seq, 16u);
  EXPECT_EQ(answers()[0]->send_limit_seq, 16u + IngestOptions{}.send_window);
  EXPECT_EQ(answers()[0]->fault_count, 0u);
  EXPECT_FALSE(answers()[0]->complete);
  EXPECT_EQ(ingest_->Stats().stored_observation_count, 16u);
  EXPECT_EQ(ingest_->Stats().commit_count, 1u);
  EXPECT_EQ(ingest_->Stats().queue_bytes, 0u);
}

TEST_F(IngestTest, AnswersNothingBeforeTheCommit) {
  HoldFirstCommit();
  EXPECT_TRUE(answers().empty());
  EXPECT_GT(ingest_->Stats().queue_bytes, 0u);
  store_.Release();
  ingest_->WaitIdle();
  EXPECT_EQ(answers().size(), 1u);
}

TEST_F(IngestTest, PutsWhatQueuedUpDuringACommitIntoTheNext) {
  HoldFirstCommit();
  for (uint32_t i = 0; i < 10; ++i) {
    ASSERT_THAT(Submit(MakeDelivery(KeyOf("a"), 1 + 4 * i, 4 + 4 * i)), IsOk());
  }
  store_.Release();
  ingest_->WaitIdle();
  EXPECT_THAT(store_.group_sizes(), ElementsAre(1, 10));
  // Each delivery has its own answer, in the order they were submitted in.
  ASSERT_EQ(answers().size(), 11u);
  for (uint32_t i = 0; i < 10; ++i) EXPECT_EQ(answers()[1 + i]->durable_seq, 4 + 4 * i);
  // Progress of a stream is reported once per commit.
  ASSERT_EQ(progress_.size(), 2u);
  EXPECT_EQ(progress_[1].first, KeyOf("a"));
  EXPECT_EQ(progress_[1].second.durable_seq, 40u);
  EXPECT_EQ(progress_[1].second.stored_rows, 40u);
  // Each delivery by itself.
  ASSERT_EQ(delivered_.size(), 11u);
  for (size_t i = 1; i < delivered_.size(); ++i) {
    EXPECT_EQ(delivered_[i], (std::pair<size_t, uint32_t>(4, 4)));
  }
}

TEST_F(IngestTest, LimitsACommit) {
  Delivery delivery = MakeDelivery(KeyOf("a"), 1, 16);
  IngestOptions options;
  options.group_limit_bytes = 3 * delivery.Bytes() + delivery.Bytes() / 2;
  Create(options);
  HoldFirstCommit();
  for (uint32_t i = 0; i < 7; ++i) {
    ASSERT_THAT(Submit(MakeDelivery(KeyOf("a"), 1 + 16 * i, 16 + 16 * i)), IsOk());
  }
  store_.Release();
  ingest_->WaitIdle();
  EXPECT_THAT(store_.group_sizes(), ElementsAre(1, 3, 3, 1));
}

TEST_F(IngestTest, CommitsADeliveryThatIsLargerThanACommitAlone) {
  IngestOptions options;
  options.group_limit_bytes = 1;
  Create(options);
  ingest_->Start();
  ASSERT_THAT(Submit(MakeDelivery(KeyOf("a"), 1, 100)), IsOk());
  ingest_->WaitIdle();
  EXPECT_THAT(answers(), ElementsAre(IsOk()));
}

TEST_F(IngestTest, SaysFullAndLeavesTheDeliveryAlone) {
  IngestOptions options;
  options.queue_limit_bytes = 1;
  Create(options);
  HoldFirstCommit();
  Delivery delivery = MakeDelivery(KeyOf("a"), 1, 16);
  delivery.batch.x_px[0] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(Submit(delivery), StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("full")));
  EXPECT_EQ(delivery.stream(), KeyOf("a"));
  EXPECT_EQ(delivery.batch.rows(), 16u);
  EXPECT_EQ(space_calls_, 0);
  store_.Release();
  ingest_->WaitIdle();
  // Room is announced once; the delivery then goes in.
  while (space_calls_ == 0) std::this_thread::yield();
  EXPECT_THAT(Submit(delivery), IsOk());
  ingest_->WaitIdle();
  ASSERT_EQ(answers().size(), 2u);
  EXPECT_EQ(answers()[1]->durable_seq, 16u);
  ingest_->Shutdown();
  EXPECT_EQ(space_calls_, 1);
}

TEST_F(IngestTest, NeverHoldsMuchMoreThanItsLimit) {
  IngestOptions options;
  options.queue_limit_bytes = 20 * MakeDelivery(KeyOf("a"), 1, 16).Bytes();
  Create(options);
  HoldFirstCommit();
  int taken = 0;
  while (taken < 1000 && Submit(MakeDelivery(KeyOf("a"), 1, 16)).ok()) ++taken;
  EXPECT_GE(taken, 19);
  EXPECT_LE(taken, 20);
}

TEST_F(IngestTest, ReportsRefusedRowsInTheAcknowledgementAndKeepsTheRest) {
  ingest_->Start();
  Delivery delivery = MakeDelivery(KeyOf("a"), 1, 40);
  for (size_t row = 10; row < 30; ++row)
    delivery.batch.time_ns[row] = std::numeric_limits<int64_t>::min();
  ASSERT_THAT(Submit(delivery), IsOk());
  ingest_->WaitIdle();
  ASSERT_THAT(answers(), ElementsAre(IsOk()));
  const BatchAck ack = *answers()[0];
  EXPECT_EQ(ack.durable_seq, 40u);
  EXPECT_EQ(ack.fault_count, 20u);
  ASSERT_EQ(ack.faults.size(), 16u);
  EXPECT_EQ(ack.faults[0],
            (ObservationFault{
                .seq = 11, .field = "time_ns[10]", .reason = RefusalReason::kImplausibleTime}));
  ASSERT_EQ(store_.deliveries().size(), 1u);
  EXPECT_EQ(store_.deliveries()[0].refused_rows.size(), 20u);
  EXPECT_EQ(store_.deliveries()[0].batch.time_ns[10], std::numeric_limits<int64_t>::min());
  EXPECT_EQ(ingest_->Stats().refused_observation_count, 20u);
  EXPECT_EQ(ingest_->Stats().stored_observation_count, 20u);
}

TEST_F(IngestTest, RefusesFaultsInProtocolAndUnknownStreamsAtOnce) {
  ingest_->Start();
  Delivery delivery = MakeDelivery(KeyOf("a"), 1, 4);
  delivery.batch.marker_count = 2;
  EXPECT_THAT(Submit(delivery), StatusIs(absl::StatusCode::kInvalidArgument,
                                         AllOf(HasSubstr("marker_count"), HasSubstr("camera a"))));
  EXPECT_EQ(delivery.batch.rows(), 4u);
  EXPECT_THAT(Submit(MakeDelivery(KeyOf("none"), 1, 4)), StatusIs(absl::StatusCode::kNotFound, _));
  StreamKey created = KeyOf("a");
  created.session_id = "s-created";
  EXPECT_THAT(Submit(MakeDelivery(created, 1, 4)),
              StatusIs(absl::StatusCode::kFailedPrecondition, _));
  ingest_->WaitIdle();
  EXPECT_EQ(ingest_->Stats().queue_bytes, 0u);
  EXPECT_TRUE(store_.group_sizes().empty());
}

TEST_F(IngestTest, PassesTheEndAndItsReportOn) {
  ingest_->Start();
  ASSERT_THAT(Submit(MakeDelivery(KeyOf("a"), 1, 16)), IsOk());
  Delivery end = EndDelivery(KeyOf("a"), 16);
  end.report.emplace().observation_count = 16;
  ASSERT_THAT(Submit(end), IsOk());
  ingest_->WaitIdle();
  ASSERT_EQ(answers().size(), 2u);
  EXPECT_FALSE(answers()[0]->complete);
  EXPECT_TRUE(answers()[1]->complete);
  ASSERT_EQ(store_.deliveries().size(), 2u);
  EXPECT_EQ(store_.deliveries()[1].last_seq, 16u);
  EXPECT_EQ(store_.deliveries()[1].report->observation_count, 16u);
  EXPECT_TRUE(progress_.back().second.complete);
}

TEST_F(IngestTest, SaysSoWhenTheSessionIsGone) {
  store_.SetUnknownSession("s-test");
  ingest_->Start();
  ASSERT_THAT(Submit(MakeDelivery(KeyOf("a"), 1, 16)), IsOk());
  ingest_->WaitIdle();
  EXPECT_THAT(answers(),
              ElementsAre(StatusIs(absl::StatusCode::kNotFound, HasSubstr("session s-test"))));
  EXPECT_TRUE(progress_.empty());
  EXPECT_EQ(ingest_->Stats().problem, "");
}

TEST_F(IngestTest, GivesBackDeliveriesWhileTheDiskIsFullAndRecoversWithTheNext) {
  store_.SetStatus(absl::ResourceExhaustedError("the disk is full"));
  ingest_->Start();
  ASSERT_THAT(Submit(MakeDelivery(KeyOf("a"), 1, 16)), IsOk());
  ingest_->WaitIdle();
  EXPECT_THAT(answers(),
              ElementsAre(StatusIs(absl::StatusCode::kResourceExhausted, "the disk is full")));
  EXPECT_EQ(ingest_->Stats().problem, "the disk is full");
  EXPECT_TRUE(progress_.empty());

  store_.SetStatus(absl::OkStatus());
  ASSERT_THAT(Submit(MakeDelivery(KeyOf("a"), 1, 16)), IsOk());
  ingest_->WaitIdle();
  EXPECT_EQ(answers().back()->durable_seq, 16u);
  EXPECT_EQ(ingest_->Stats().problem, "");
  EXPECT_EQ(ingest_->Stats().commit_count, 1u);
}

TEST_F(IngestTest, NoticesRoomOnTheDiskWithoutADelivery) {
  store_.SetStatus(absl::ResourceExhaustedError("the disk is full"));
  ingest_->Start();
  ASSERT_THAT(Submit(MakeDelivery(KeyOf("a"), 1, 16)), IsOk());
  ingest_->WaitIdle();
  store_.SetFreeBytes(1u << 30);
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (!ingest_->Stats().problem.empty() && std::chrono::steady_clock::now() < deadline) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  EXPECT_EQ(ingest_->Stats().problem, "");
}

TEST_F(IngestTest, StopsTakingAfterAnyOtherErrorOfTheStore) {
  HoldFirstCommit();
  ASSERT_THAT(Submit(MakeDelivery(KeyOf("a"), 1, 16)), IsOk());
  store_.SetStatus(absl::InternalError("fsync failed"));
  store_.Release();
  ingest_->WaitIdle();
  EXPECT_THAT(answers(), ElementsAre(StatusIs(absl::StatusCode::kInternal, HasSubstr("fsync")),
                                     StatusIs(absl::StatusCode::kInternal, HasSubstr("fsync"))));
  EXPECT_THAT(ingest_->Stats().problem, HasSubstr("fsync failed"));
  // Not even when the store would accept it again: its contents are no longer certain.
  store_.SetStatus(absl::OkStatus());
  EXPECT_THAT(Submit(MakeDelivery(KeyOf("a"), 1, 16)),
              StatusIs(absl::StatusCode::kInternal, HasSubstr("fsync failed")));
  EXPECT_EQ(store_.group_sizes().size(), 1u);
}

TEST_F(IngestTest, WritesWhatWasTakenBeforeItShutsDown) {
  HoldFirstCommit();
  ASSERT_THAT(Submit(MakeDelivery(KeyOf("a"), 1, 16)), IsOk());
  std::thread shutdown([this] { ingest_->Shutdown(); });
  // At some point nothing is accepted any more; every accepted delivery is answered.
  int taken = 2;
  while (Submit(MakeDelivery(KeyOf("b"), 1, 1)).ok() && taken < 1'000'000) ++taken;
  store_.Release();
  shutdown.join();
  EXPECT_THAT(Submit(MakeDelivery(KeyOf("b"), 1, 1)),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("shutting down")));
  EXPECT_EQ(answers().size(), static_cast<size_t>(taken));
  for (const auto& answer : answers()) EXPECT_THAT(answer, IsOk());
}

TEST_F(IngestTest, AnnouncesRoomAtShutdownToo) {
  IngestOptions options;
  options.queue_limit_bytes = 1;
  Create(options);
  HoldFirstCommit();
  EXPECT_THAT(Submit(MakeDelivery(KeyOf("a"), 1, 16)),
              StatusIs(absl::StatusCode::kResourceExhausted, _));
  store_.Release();
  ingest_->Shutdown();
  EXPECT_EQ(space_calls_, 1);
}

TEST_F(IngestTest, AnswersWhatAWriterThatNeverRanDidNotWrite) {
  ASSERT_THAT(Submit(MakeDelivery(KeyOf("a"), 1, 16)), IsOk());
  ingest_->Shutdown();
  EXPECT_THAT(answers(), ElementsAre(StatusIs(absl::StatusCode::kUnavailable, _)));
}

TEST_F(IngestTest, SurvivesWhatItsCallbacksThrow) {
  ASSERT_NO_FATAL_FAILURE(HoldFirstCommit());
  // In one commit with others: theirs are called.
  Delivery thrown = MakeDelivery(KeyOf("a"), 1, 3);
  ASSERT_THAT(ingest_->Submit(
                  thrown, [](absl::StatusOr<BatchAck>) { throw std::bad_alloc(); }, [] {}),
              IsOk());
  ASSERT_THAT(Submit(MakeDelivery(KeyOf("b"), 1, 3)), IsOk());
  throw_at_progress_ = true;
  throw_at_delivery_ = true;
  store_.Release();
  ingest_->WaitIdle();
  EXPECT_EQ(store_.deliveries().size(), 3u) << "what was stored stays stored";
  EXPECT_THAT(answers(), ::testing::SizeIs(2));
  // Of three streams and three deliveries one hook each has thrown.
  {
    const std::lock_guard lock(mutex_);
    EXPECT_EQ(progress_.size(), 2u);
    EXPECT_EQ(delivered_.size(), 2u);
  }
  ASSERT_THAT(Submit(MakeDelivery(KeyOf("a"), 4, 6)), IsOk());
  ingest_->WaitIdle();
  EXPECT_THAT(answers(), ::testing::SizeIs(3));
  EXPECT_THAT(answers().back(), IsOk());
  EXPECT_EQ(ingest_->Stats().problem, "");
}

TEST_F(IngestTest, LetsCallbacksSubmit) {
  ingest_->Start();
  std::atomic<int> left = 20;
  std::function<void(absl::StatusOr<BatchAck>)> next = [&](absl::StatusOr<BatchAck> ack) {
    EXPECT_THAT(ack, IsOk());
    if (--left < 0) return;
    Delivery delivery = MakeDelivery(KeyOf("a"), ack->durable_seq + 1, ack->durable_seq + 2);
    EXPECT_THAT(ingest_->Submit(delivery, next, nullptr), IsOk());
  };
  Delivery first = MakeDelivery(KeyOf("a"), 1, 2);
  ASSERT_THAT(ingest_->Submit(first, next, nullptr), IsOk());
  while (left >= 0) std::this_thread::yield();
  ingest_->WaitIdle();
  EXPECT_EQ(ingest_->Stats().stored_observation_count, 42u);
}

TEST_F(IngestTest, LimitsTheSendLimitToWhatNumbersCanSay) {
  ingest_->Start();
  Delivery delivery = MakeDelivery(KeyOf("a"), 1, 1);
  delivery.batch.dropped = {
      {.first_seq = 2, .count = kMaxSeq - 1, .reason = RefusalReason::kSpoolFreed}};
  ASSERT_THAT(Submit(delivery), IsOk());
  ingest_->WaitIdle();
  ASSERT_THAT(answers(), ElementsAre(IsOk()));
  EXPECT_EQ(answers()[0]->durable_seq, kMaxSeq);
  EXPECT_EQ(answers()[0]->send_limit_seq, std::numeric_limits<uint32_t>::max());
}

// Many senders against a small queue: every delivery is answered once, each stream in its order.
TEST_F(IngestTest, ServesManySendersWithASmallQueue) {
  constexpr uint32_t kBatches = 200;
  IngestOptions options;
  options.queue_limit_bytes = 10 * MakeDelivery(KeyOf("a"), 1, 4).Bytes();
  options.group_limit_bytes = options.queue_limit_bytes / 3;
  Create(options);
  ingest_->Start();
  std::map<std::string, std::atomic<uint32_t>> answered;
  for (const char* camera : {"a", "b", "c", "d"}) answered[camera] = 0;
  std::vector<std::thread> senders;
  for (auto& [camera, count] : answered) {
    senders.emplace_back([this, camera = camera, &count = count] {
      for (uint32_t i = 0; i < kBatches; ++i) {
        Delivery delivery = MakeDelivery(KeyOf(camera), 1 + 4 * i, 4 + 4 * i);
        const auto done = [&count, i](absl::StatusOr<BatchAck> ack) {
          EXPECT_THAT(ack, IsOk());
          EXPECT_EQ(ack->durable_seq, 4 + 4 * i);
          EXPECT_EQ(count++, i);
        };
        for (;;) {  // ends: room is announced
          const auto space = std::make_shared<std::promise<void>>();
          const absl::Status status =
              ingest_->Submit(delivery, done, [space] { space->set_value(); });
          if (status.ok()) break;
          ASSERT_THAT(status, StatusIs(absl::StatusCode::kResourceExhausted, _));
          space->get_future().wait();
        }
      }
    });
  }
  for (std::thread& sender : senders) sender.join();
  ingest_->WaitIdle();
  for (const auto& [camera, count] : answered) EXPECT_EQ(count, kBatches) << camera;
  EXPECT_EQ(ingest_->Stats().stored_observation_count, 4 * 4 * kBatches);
  EXPECT_EQ(ingest_->Stats().queue_bytes, 0u);
}

}  // namespace
}  // namespace rigcal::server::ingest_test

// SPDX-License-Identifier: Apache-2.0
#include "server/ingest/ingest_queue.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <optional>
#include <thread>
#include <utility>

#include "tests/server/store/store_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::ingest_queue_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::KeyOf;
using ::rigcal::testing::MakeBatch;
using ::rigcal::testing::StatusIs;
using ::testing::_;
using ::testing::SizeIs;

constexpr std::chrono::milliseconds kAtOnce{0};

class IngestQueueTest : public ::testing::Test {
 protected:
  static Delivery Rows(uint32_t count) { return {.batch = MakeBatch(KeyOf("a"), 1, count)}; }
  absl::Status Reserve(size_t bytes) {
    std::function<void()> on_space = [this] { ++space_calls_; };
    return queue_.Reserve(bytes, on_space);
  }
  void Push(Delivery delivery, IngestCallback done = nullptr) {
    const size_t bytes = delivery.Bytes();
    ASSERT_THAT(Reserve(bytes), IsOk());
    queue_.Push(std::move(delivery), std::move(done), bytes);
  }

  const size_t delivery_bytes_ = Rows(16).Bytes();
  IngestQueue queue_{10 * delivery_bytes_, 3 * delivery_bytes_};
  int space_calls_ = 0;
};

TEST_F(IngestQueueTest, HoldsRoomUntilTheGroupIsFinished) {
  Push(Rows(16));
  EXPECT_EQ(queue_.held_bytes(), delivery_bytes_);
  std::optional<IngestQueue::Group> group = queue_.Take();
  ASSERT_TRUE(group);
  EXPECT_THAT(group->deliveries, SizeIs(1));
  EXPECT_EQ(queue_.held_bytes(), delivery_bytes_);
  queue_.Finish(*std::move(group));
  EXPECT_EQ(queue_.held_bytes(), 0u);
  queue_.WaitIdle();
}

TEST_F(IngestQueueTest, CountsWhatADeliveryHasGrownBySinceItsReservation) {
  Delivery delivery = Rows(16);
  ASSERT_THAT(Reserve(delivery.Bytes()), IsOk());
  delivery.refused_rows.resize(4);
  const size_t grown_bytes = delivery.Bytes();
  EXPECT_GT(grown_bytes, delivery_bytes_);
  queue_.Push(std::move(delivery), nullptr, delivery_bytes_);
  EXPECT_EQ(queue_.held_bytes(), grown_bytes);
  queue_.Finish(*queue_.Take());
  EXPECT_EQ(queue_.held_bytes(), 0u);
}

TEST_F(IngestQueueTest, LimitsAGroupButNotASingleDelivery) {
  for (int i = 0; i < 5; ++i) Push(Rows(16));
  EXPECT_THAT(queue_.Take()->deliveries, SizeIs(3));
  EXPECT_THAT(queue_.Take()->deliveries, SizeIs(2));
  Push(Rows(200));
  EXPECT_THAT(queue_.Take()->deliveries, SizeIs(1));
}

TEST_F(IngestQueueTest, CallsForSubmittersWhenHalfOfItIsFree) {
  for (int i = 0; i < 10; ++i) Push(Rows(16));
  EXPECT_THAT(Reserve(1), StatusIs(absl::StatusCode::kResourceExhausted, _));
  for (int taken = 0; taken < 6; taken += 3) {
    std::optional<IngestQueue::Group> group = queue_.Take();
    EXPECT_THAT(group->on_space, SizeIs(0)) << "of 10 deliveries " << taken << " are written";
    queue_.Finish(*std::move(group));
  }
  EXPECT_THAT(queue_.Take()->on_space, SizeIs(1));
  EXPECT_EQ(space_calls_, 0) << "the writer calls them, not the queue";
}

TEST_F(IngestQueueTest, GivesAnEmptyGroupAfterTheTimeout) {
  EXPECT_THAT(queue_.Take(kAtOnce)->deliveries, SizeIs(0));
  queue_.WaitIdle();
}

TEST_F(IngestQueueTest, EndsWhenItIsClosedAndEverythingIsTaken) {
  Push(Rows(16));
  ASSERT_THAT(Reserve(delivery_bytes_), IsOk());
  queue_.Close();
  EXPECT_THAT(Reserve(1), StatusIs(absl::StatusCode::kUnavailable, _));
  EXPECT_THAT(queue_.Take()->deliveries, SizeIs(1));
  // The other one is still being checked.
  EXPECT_THAT(queue_.Take(kAtOnce)->deliveries, SizeIs(0));
  queue_.Push(Rows(16), nullptr, delivery_bytes_);
  EXPECT_THAT(queue_.Take()->deliveries, SizeIs(1));
  EXPECT_FALSE(queue_.Take());
}

TEST_F(IngestQueueTest, GivesWaitingSubmittersBackWhenItIsClosed) {
  for (int i = 0; i < 10; ++i) Push(Rows(16));
  EXPECT_THAT(Reserve(1), StatusIs(absl::StatusCode::kResourceExhausted, _));
  queue_.Close();
  EXPECT_THAT(queue_.Take()->on_space, SizeIs(1));
}

TEST_F(IngestQueueTest, WakesTheWriterWhenTheLastReservationIsReleased) {
  ASSERT_THAT(Reserve(delivery_bytes_), IsOk());
  queue_.Close();
  std::thread writer([this] { EXPECT_FALSE(queue_.Take()); });
  queue_.Release(delivery_bytes_);
  writer.join();
  EXPECT_EQ(queue_.held_bytes(), 0u);
}

// A callback's last reference may call the queue.
TEST_F(IngestQueueTest, DestroysCallbacksOutsideOfItsLock) {
  auto probe = std::shared_ptr<int>(new int(0), [this](const int* value) {
    EXPECT_EQ(queue_.held_bytes(), delivery_bytes_);
    delete value;
  });
  Push(Rows(16), [held = probe](absl::StatusOr<BatchAck>) {});
  std::weak_ptr<int> watched = probe;
  std::optional<IngestQueue::Group> group = queue_.Take();
  probe.reset();
  queue_.Finish(*std::move(group));
  EXPECT_TRUE(watched.expired());
}

}  // namespace
}  // namespace rigcal::server::ingest_queue_test

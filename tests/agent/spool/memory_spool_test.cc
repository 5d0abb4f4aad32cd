// SPDX-License-Identifier: Apache-2.0
#include "agent/spool/memory_spool.h"

#include <rapidcheck.h>

#include <algorithm>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include "tests/agent/uplink/scripted_source.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::memory_spool_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::_;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const StreamKey kLeft{"s-1", "left", 3};
const StreamKey kRight{"s-1", "right", 3};

// One marker: 8 + 4 bytes and 29 for the marker.
constexpr size_t kRowBytes = 41;

void AppendRows(MemorySpool& spool, const StreamKey& stream, int64_t first, int64_t last) {
  for (int64_t row = first; row <= last; ++row) {
    ASSERT_THAT(spool.Append(stream, MakeObservation(row), {}), IsOk());
  }
}

TEST(MemorySpool, NumbersObservationsAndReadsThemBack) {
  MemorySpool spool;
  ASSERT_THAT(spool.Open(kLeft, 1, 1), IsOk());
  for (uint32_t row = 1; row <= 600; ++row) {
    ASSERT_OK_AND_ASSIGN(const uint32_t seq, spool.Append(kLeft, MakeObservation(row * 10), {}));
    ASSERT_EQ(seq, row);
  }
  uint32_t next = 1;
  while (next <= 600) {
    ASSERT_OK_AND_ASSIGN(const ObservationBatch batch, spool.Read(kLeft, next, 100));
    ASSERT_GE(batch.rows(), 1u);
    ASSERT_LE(batch.rows(), 100u);
    EXPECT_EQ(batch.stream, kLeft);
    EXPECT_EQ(batch.first_seq, next);
    EXPECT_EQ(batch.marker_count, 1u);
    for (size_t row = 0; row < batch.rows(); ++row) {
      ASSERT_EQ(batch.time_ns[row], int64_t{10} * (next + static_cast<uint32_t>(row)));
    }
    next = batch.end_seq();
  }
  ASSERT_OK_AND_ASSIGN(const ObservationBatch beyond, spool.Read(kLeft, 601, 100));
  EXPECT_EQ(beyond.rows(), 0u);
  EXPECT_THAT(beyond.dropped, IsEmpty());
}

TEST(MemorySpool, KeepsClockEpochsInBatchesOfTheirOwn) {
  MemorySpool spool;
  ASSERT_THAT(spool.Open(kLeft, 1, 1), IsOk());
  for (const uint32_t epoch : {0u, 0u, 1u, 1u, 1u, 2u}) {
    ASSERT_THAT(spool.Append(kLeft, MakeObservation(5, epoch), {}), IsOk());
  }
  std::vector<size_t> rows;
  std::vector<uint32_t> epochs;
  for (uint32_t next = 1; next <= 6;) {
    ASSERT_OK_AND_ASSIGN(const ObservationBatch batch, spool.Read(kLeft, next, 100));
    rows.push_back(batch.rows());
    epochs.push_back(batch.clock_epoch);
    next = batch.end_seq();
  }
  EXPECT_THAT(rows, ElementsAre(2, 3, 1));
  EXPECT_THAT(epochs, ElementsAre(0, 1, 2));
}

TEST(MemorySpool, GivesClockSamplesWithTheObservationTheyWereReadWith) {
  MemorySpool spool;
  ASSERT_THAT(spool.Open(kLeft, 1, 1), IsOk());
  for (int row = 1; row <= 4; ++row) {
    ASSERT_THAT(
        spool.Append(
            kLeft, MakeObservation(row),
            {ClockSample{
                .device_ns = row, .host_monotonic_ns = 1, .host_utc_ns = 2, .uncertainty_ns = 3}}),
        IsOk());
  }
  ASSERT_OK_AND_ASSIGN(const ObservationBatch middle, spool.Read(kLeft, 2, 2));
  ASSERT_EQ(middle.clock_samples.size(), 2u);
  EXPECT_EQ(middle.clock_samples[0].device_ns, 2);
  EXPECT_EQ(middle.clock_samples[1].device_ns, 3);
  // Acknowledged in the middle of a chunk, the rest keeps its samples.
  spool.Acknowledge(kLeft, 3);
  ASSERT_OK_AND_ASSIGN(const ObservationBatch rest, spool.Read(kLeft, 4, 9));
  ASSERT_EQ(rest.clock_samples.size(), 1u);
  EXPECT_EQ(rest.clock_samples[0].device_ns, 4);
}

TEST(MemorySpool, FreesWhatIsAcknowledgedAndNothingElse) {
  MemorySpool spool;
  ASSERT_THAT(spool.Open(kLeft, 1, 1), IsOk());
  AppendRows(spool, kLeft, 1, 1000);
  EXPECT_EQ(spool.bytes(), 1000 * kRowBytes);
  spool.Acknowledge(kLeft, 600);
  EXPECT_LT(spool.bytes(), 1000 * kRowBytes);
  EXPECT_GE(spool.bytes(), 400 * kRowBytes);
  ASSERT_OK_AND_ASSIGN(const ObservationBatch batch, spool.Read(kLeft, 601, 1));
  EXPECT_EQ(batch.time_ns.at(0), 601);
  spool.Acknowledge(kLeft, 1000);
  EXPECT_EQ(spool.bytes(), 0u);
  // Late, repeated and premature acknowledgements change nothing.
  spool.Acknowledge(kLeft, 3);
  spool.Acknowledge(kLeft, 5000);
  spool.Acknowledge(kRight, 1);
  AppendRows(spool, kLeft, 1001, 1001);
  EXPECT_EQ(spool.Discard(kLeft), 1u);
}

TEST(MemorySpool, SaysWhatIsNoLongerThere) {
  MemorySpool spool;
  ASSERT_THAT(spool.Open(kLeft, 1, 1), IsOk());
  AppendRows(spool, kLeft, 1, 300);
  spool.Acknowledge(kLeft, 256);
  ASSERT_OK_AND_ASSIGN(const ObservationBatch batch, spool.Read(kLeft, 11, 5));
  EXPECT_THAT(batch.dropped, ElementsAre(DroppedRange{11, 246, RefusalReason::kSpoolFreed}));
  EXPECT_EQ(batch.first_seq, 257u);
  EXPECT_EQ(batch.rows(), 5u);
}

TEST(MemorySpool, NumbersFromWhereItIsTold) {
  MemorySpool spool;
  ASSERT_THAT(spool.Open(kLeft, 1, 41), IsOk());
  ASSERT_OK_AND_ASSIGN(const uint32_t seq, spool.Append(kLeft, MakeObservation(7), {}));
  EXPECT_EQ(seq, 41u);
  ASSERT_THAT(spool.Finish(kLeft, {}), IsOk());
  const auto spooled = spool.Find(kLeft);
  ASSERT_TRUE(spooled && spooled->end);
  EXPECT_EQ(spooled->end->last_seq, 41u);
  EXPECT_EQ(spooled->end->report.observation_count, 1u);
  EXPECT_EQ(spool.Discard(kLeft), 1u);
}

TEST(MemorySpool, EndsAStreamWithItsReport) {
  MemorySpool spool;
  ASSERT_THAT(spool.Open(kLeft, 1, 1), IsOk());
  ASSERT_THAT(spool.Open(kRight, 1, 1), IsOk());
  AppendRows(spool, kLeft, 1, 3);
  CameraReport report;
  report.refused = {{"", RefusalReason::kCsvBadTime, 2, "f.csv:1"}};
  ASSERT_THAT(spool.Finish(kLeft, report), IsOk());
  ASSERT_THAT(spool.Finish(kRight, {}), IsOk());
  const std::vector<SpooledStream> streams = spool.Streams();
  ASSERT_EQ(streams.size(), 2u);
  ASSERT_TRUE(streams[0].end && streams[1].end);
  EXPECT_EQ(streams[0].end->last_seq, 3u);
  EXPECT_EQ(streams[0].end->stream, kLeft);
  EXPECT_EQ(streams[0].end->report.stream, kLeft);
  EXPECT_EQ(streams[0].end->report.observation_count, 3u);
  EXPECT_EQ(streams[0].end->report.refused, report.refused);
  EXPECT_EQ(streams[1].end->last_seq, 0u);
  EXPECT_THAT(spool.Append(kLeft, MakeObservation(4), {}),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("has ended")));
}

TEST(MemorySpool, RefusesWhatDoesNotFit) {
  MemorySpool spool;
  EXPECT_THAT(spool.Append(kLeft, MakeObservation(1), {}),
              StatusIs(absl::StatusCode::kNotFound,
                       AllOf(HasSubstr("camera left"), HasSubstr("session s-1"))));
  EXPECT_THAT(spool.Read(kLeft, 1, 1), StatusIs(absl::StatusCode::kNotFound, _));
  EXPECT_THAT(spool.Finish(kLeft, {}), StatusIs(absl::StatusCode::kNotFound, _));
  EXPECT_EQ(spool.Discard(kLeft), 0u);
  ASSERT_THAT(spool.Open(kLeft, 2, 1), IsOk());
  EXPECT_THAT(spool.Open(kLeft, 2, 1), StatusIs(absl::StatusCode::kAlreadyExists, _));
  EXPECT_THAT(spool.Append(kLeft, MakeObservation(1, 0, 3), {}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("3 markers")));
}

TEST(MemorySpool, MakesAppendWaitWhileItIsFull) {
  MemorySpool spool(10 * kRowBytes);
  ASSERT_THAT(spool.Open(kLeft, 1, 1), IsOk());
  std::thread source([&] { AppendRows(spool, kLeft, 1, 5000); });
  uint32_t next = 1;
  while (next <= 5000) {
    EXPECT_LE(spool.bytes(), 10 * kRowBytes);
    const auto batch = spool.Read(kLeft, next, 100);
    ASSERT_THAT(batch, IsOk());
    if (batch->rows() == 0) {
      std::this_thread::yield();
      continue;
    }
    ASSERT_EQ(batch->first_seq, next);
    ASSERT_EQ(batch->time_ns[0], next);
    next = batch->end_seq();
    spool.Acknowledge(kLeft, next - 1);
  }
  source.join();
  EXPECT_EQ(spool.bytes(), 0u);
}

TEST(MemorySpool, EndsAWaitingAppendWhenTheStreamIsDiscardedOrTheAgentEnds) {
  MemorySpool spool(2 * kRowBytes);
  ASSERT_THAT(spool.Open(kLeft, 1, 1), IsOk());
  ASSERT_THAT(spool.Open(kRight, 1, 1), IsOk());
  AppendRows(spool, kRight, 1, 2);
  std::thread discarded([&] {
    EXPECT_THAT(spool.Append(kLeft, MakeObservation(1), {}),
                StatusIs(absl::StatusCode::kNotFound, _));
  });
  spool.Discard(kLeft);
  discarded.join();
  std::thread ended([&] {
    EXPECT_THAT(spool.Append(kRight, MakeObservation(1), {}),
                StatusIs(absl::StatusCode::kCancelled, _));
  });
  spool.Shutdown();
  ended.join();
  // What it holds can still be delivered.
  ASSERT_OK_AND_ASSIGN(const ObservationBatch batch, spool.Read(kRight, 1, 9));
  EXPECT_EQ(batch.rows(), 2u);
}

TEST(MemorySpool, TakesARowThatIsLargerThanItsLimitAlone) {
  MemorySpool spool(1);
  ASSERT_THAT(spool.Open(kLeft, 1, 1), IsOk());
  ASSERT_THAT(spool.Append(kLeft, MakeObservation(1), {}), IsOk());
  spool.Acknowledge(kLeft, 1);
  ASSERT_THAT(spool.Append(kLeft, MakeObservation(2), {}), IsOk());
}

// Against a model that keeps everything: after any order of appending, acknowledging and reading, a
// read returns exactly the appended rows from its first number on, as far as they are kept.
TEST(MemorySpool, AgreesWithAModel) {
  struct Row {
    int64_t time_ns;
    uint32_t epoch;
  };
  const bool holds = rc::check([] {
    MemorySpool spool;
    const auto first_seq = *rc::gen::inRange<uint32_t>(1, 1000);
    RC_ASSERT(spool.Open(kLeft, 1, first_seq).ok());
    std::vector<Row> model;
    uint32_t durable_seq = first_seq - 1;
    uint32_t epoch = 0;
    const int steps = *rc::gen::inRange(1, 60);
    for (int step = 0; step < steps; ++step) {
      const auto end_seq = first_seq + static_cast<uint32_t>(model.size());
      switch (*rc::gen::inRange(0, 4)) {
        case 0:
        case 1: {
          epoch += *rc::gen::inRange<uint32_t>(0, 8) == 0 ? 1 : 0;
          const int rows = *rc::gen::inRange(1, 200);
          for (int row = 0; row < rows; ++row) {
            model.push_back({*rc::gen::inRange<int64_t>(0, 1'000'000), epoch});
            const auto seq = spool.Append(kLeft, MakeObservation(model.back().time_ns, epoch), {});
            RC_ASSERT(seq.ok());
            RC_ASSERT(*seq == end_seq + static_cast<uint32_t>(row));
          }
          break;
        }
        case 2: {
          const auto acknowledged = *rc::gen::inRange<uint32_t>(0, end_seq + 10);
          spool.Acknowledge(kLeft, acknowledged);
          durable_seq = std::max(durable_seq, std::min(acknowledged, end_seq - 1));
          break;
        }
        default: {
          const auto from = *rc::gen::inRange<uint32_t>(durable_seq + 1, end_seq + 2);
          const auto max_rows = *rc::gen::inRange<size_t>(1, 400);
          const auto batch = spool.Read(kLeft, from, max_rows);
          RC_ASSERT(batch.ok());
          RC_ASSERT(batch->dropped.empty());
          RC_ASSERT(batch->rows() <= max_rows);
          RC_ASSERT((batch->rows() == 0) == (from >= end_seq));
          for (size_t row = 0; row < batch->rows(); ++row) {
            const Row& expected = model.at(from - first_seq + row);
            RC_ASSERT(batch->time_ns[row] == expected.time_ns);
            RC_ASSERT(batch->clock_epoch == expected.epoch);
          }
        }
      }
      const auto spooled = spool.Find(kLeft);
      RC_ASSERT(spooled.has_value());
      RC_ASSERT(spooled->end_seq == first_seq + model.size());
      RC_ASSERT(spooled->first_seq <= durable_seq + 1);
      const size_t kept = spooled->end_seq - spooled->first_seq;
      RC_ASSERT(spool.bytes() == kept * kRowBytes);
    }
    RC_ASSERT(spool.Discard(kLeft) == first_seq + model.size() - 1 - durable_seq);
    RC_ASSERT(spool.bytes() == 0u);
  });
  EXPECT_TRUE(holds);
}

}  // namespace
}  // namespace rigcal::agent::memory_spool_test

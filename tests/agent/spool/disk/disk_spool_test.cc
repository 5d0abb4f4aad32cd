// SPDX-License-Identifier: Apache-2.0
#include "agent/spool/disk/disk_spool.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <string>
#include <thread>
#include <vector>

#include "tests/agent/spool/disk/spool_reading.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::disk_spool_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::_;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

const StreamKey kLeft{"s-1", "left", 3};
const StreamKey kRight{"s-1", "right", 3};

size_t SegmentCount(const ModelFileSystem& files) {
  const std::vector<std::string> names = files.Names();
  return static_cast<size_t>(
      std::ranges::count_if(names, [](const std::string& name) { return name.ends_with(".seg"); }));
}

TEST(DiskSpool, NumbersObservationsAndReadsThemBackOverManySegments) {
  ModelFileSystem files;
  const auto spool = OpenSpool(files);
  ASSERT_THAT(spool->Open(kLeft, 1, 1), IsOk());
  ASSERT_THAT(spool->Open(kRight, 1, 41), IsOk());
  AppendRows(*spool, kLeft, 1, 5000);
  AppendRows(*spool, kRight, 41, 60);
  EXPECT_GT(SegmentCount(files), 4u);
  EXPECT_THAT(ReadRows(*spool, kLeft, 1).rows, SizeIs(5000));
  EXPECT_THAT(ReadRows(*spool, kLeft, 1).dropped, IsEmpty());
  EXPECT_THAT(ReadRows(*spool, kRight, 41).rows, SizeIs(20));
  // From the middle, and backwards as after a reconnection.
  ASSERT_OK_AND_ASSIGN(const ObservationBatch batch, spool->Read(kLeft, 3456, 7));
  EXPECT_EQ(batch.first_seq, 3456u);
  EXPECT_EQ(batch.rows(), 7u);
  EXPECT_EQ(batch.time_ns[6], 3462 * kRowNs);
  ASSERT_OK_AND_ASSIGN(const ObservationBatch beyond, spool->Read(kLeft, 5001, 9));
  EXPECT_EQ(beyond.rows(), 0u);
  EXPECT_THAT(beyond.dropped, IsEmpty());
}

TEST(DiskSpool, KeepsClockEpochsApartAndSamplesWithTheirRow) {
  ModelFileSystem files;
  const auto spool = OpenSpool(files);
  ASSERT_THAT(spool->Open(kLeft, 1, 1), IsOk());
  const uint32_t epochs[] = {0, 0, 1, 1, 1, 2};
  for (uint32_t i = 0; i < 6; ++i) {
    ASSERT_THAT(spool->Append(kLeft, MakeObservation(5, epochs[i]), {{.device_ns = i}}), IsOk());
  }
  std::vector<size_t> rows;
  for (uint32_t next = 1; next <= 6;) {
    ASSERT_OK_AND_ASSIGN(const ObservationBatch batch, spool->Read(kLeft, next, 100));
    rows.push_back(batch.rows());
    EXPECT_EQ(batch.clock_epoch, epochs[next - 1]);
    ASSERT_THAT(batch.clock_samples, SizeIs(batch.rows()));
    EXPECT_EQ(batch.clock_samples[0].device_ns, next - 1);
    next = batch.end_seq();
  }
  EXPECT_THAT(rows, ElementsAre(2, 3, 1));
}

TEST(DiskSpool, GivesRowsReadAheadOnceAndSamplesWithTheirRow) {
  ModelFileSystem files;
  const auto spool = OpenSpool(files);
  ASSERT_THAT(spool->Open(kLeft, 1, 1), IsOk());
  for (uint32_t seq = 1; seq <= 1000; ++seq) {
    std::vector<ClockSample> samples;
    if (seq % 70 == 0) samples.push_back({.device_ns = seq});
    ASSERT_THAT(spool->Append(kLeft, MakeObservation(seq * kRowNs), samples), IsOk());
  }
  std::vector<int64_t> sample_times;
  for (uint32_t next = 1; next <= 1000;) {
    ASSERT_OK_AND_ASSIGN(const ObservationBatch batch, spool->Read(kLeft, next, 16));
    ASSERT_EQ(batch.first_seq, next);
    ASSERT_GE(batch.rows(), 1u);
    ASSERT_LE(batch.rows(), 16u);
    for (size_t row = 0; row < batch.rows(); ++row) {
      ASSERT_EQ(batch.time_ns[row], (next + static_cast<int64_t>(row)) * kRowNs);
    }
    for (const ClockSample& sample : batch.clock_samples) {
      EXPECT_GE(sample.device_ns, batch.first_seq);
      EXPECT_LT(sample.device_ns, batch.end_seq());
      sample_times.push_back(sample.device_ns);
    }
    next = batch.end_seq();
  }
  EXPECT_THAT(sample_times, SizeIs(14));
  EXPECT_TRUE(std::ranges::is_sorted(sample_times));
}

TEST(DiskSpool, DoesNotGiveRowsReadAheadThatItHasDropped) {
  ModelFileSystem files;
  DiskSpoolOptions options = ModelOptions();
  options.limit_bytes = uint64_t{256} << 10;
  options.full = SpoolFull::kDropOldest;
  const auto spool = OpenSpool(files, options);
  ASSERT_THAT(spool->Open(kLeft, 1, 1), IsOk());
  AppendRows(*spool, kLeft, 1, 100);
  ASSERT_OK_AND_ASSIGN(const ObservationBatch first, spool->Read(kLeft, 1, 16));
  ASSERT_EQ(first.rows(), 16u);
  AppendRows(*spool, kLeft, 101, 10'000);  // drops the segment with the first rows
  ASSERT_GT(spool->Status().dropped.size(), 0u);
  const ReadStreamRows read = ReadRows(*spool, kLeft, 17);
  EXPECT_FALSE(read.rows.contains(17));
  EXPECT_EQ(spool->Find(kLeft)->row_count, read.rows.size());
}

TEST(DiskSpool, RefusesWhatDoesNotFit) {
  ModelFileSystem files;
  const auto spool = OpenSpool(files);
  EXPECT_THAT(spool->Append(kLeft, MakeObservation(1), {}),
              StatusIs(absl::StatusCode::kNotFound,
                       AllOf(HasSubstr("camera left"), HasSubstr("session s-1"))));
  EXPECT_THAT(spool->Read(kLeft, 1, 1), StatusIs(absl::StatusCode::kNotFound, _));
  EXPECT_THAT(spool->Finish(kLeft, {}), StatusIs(absl::StatusCode::kNotFound, _));
  EXPECT_EQ(spool->Discard(kLeft), 0u);
  ASSERT_THAT(spool->Open(kLeft, 2, 1), IsOk());
  EXPECT_THAT(spool->Open(kLeft, 2, 1), StatusIs(absl::StatusCode::kAlreadyExists, _));
  EXPECT_THAT(spool->Append(kLeft, MakeObservation(1, 0, 3), {}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("3 markers")));
  ASSERT_THAT(spool->Finish(kLeft, {}), IsOk());
  EXPECT_THAT(spool->Append(kLeft, MakeObservation(1, 0, 2), {}),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("has ended")));
  spool->Shutdown();
  EXPECT_THAT(spool->Append(kLeft, MakeObservation(1, 0, 2), {}),
              StatusIs(absl::StatusCode::kCancelled, _));
}

TEST(DiskSpool, DeletesASegmentOnlyOnceACheckpointThatPassesItIsDurable) {
  ModelFileSystem files;
  const auto spool = OpenSpool(files);
  ASSERT_THAT(spool->Open(kLeft, 1, 1), IsOk());
  AppendRows(*spool, kLeft, 1, 5000);
  const size_t segments = SegmentCount(files);
  const uint64_t bytes = spool->Status().bytes;
  spool->Acknowledge(kLeft, 4000);
  EXPECT_EQ(SegmentCount(files), segments);
  spool->Maintain();
  EXPECT_LT(SegmentCount(files), segments);
  EXPECT_LT(spool->Status().bytes, bytes);
  EXPECT_EQ(spool->Status().row_count, 1000u);
  EXPECT_EQ(ReadRows(*spool, kLeft, 4001).rows.size(), 1000u);
  // Late, repeated and premature acknowledgements change nothing.
  spool->Acknowledge(kLeft, 3);
  spool->Acknowledge(kLeft, 100'000);
  spool->Acknowledge(kRight, 1);
  AppendRows(*spool, kLeft, 5001, 5001);
  EXPECT_EQ(spool->Discard(kLeft), 1u);
  spool->Maintain();
  EXPECT_EQ(SegmentCount(files), 0u);
  EXPECT_EQ(spool->Status().bytes, 0u);
}

TEST(DiskSpool, SaysWhatIsNoLongerThere) {
  ModelFileSystem files;
  const auto spool = OpenSpool(files);
  ASSERT_THAT(spool->Open(kLeft, 1, 1), IsOk());
  AppendRows(*spool, kLeft, 1, 3000);
  spool->Acknowledge(kLeft, 2500);
  spool->Maintain();
  const uint32_t first_seq = spool->Find(kLeft)->first_seq;
  EXPECT_GT(first_seq, 1000u);
  ASSERT_OK_AND_ASSIGN(const ObservationBatch batch, spool->Read(kLeft, 11, 5));
  EXPECT_THAT(batch.dropped,
              ElementsAre(DroppedRange{11, first_seq - 11, RefusalReason::kSpoolFreed}));
  EXPECT_EQ(batch.first_seq, first_seq);
}

TEST(DiskSpool, DeliversAfterARestartWhatItsProcessHadAppended) {
  ModelFileSystem files;
  auto spool = OpenSpool(files);
  ASSERT_THAT(spool->Open(kLeft, 1, 1), IsOk());
  ASSERT_THAT(spool->Open(kRight, 1, 5), IsOk());
  AppendRows(*spool, kLeft, 1, 2500);
  AppendRows(*spool, kRight, 5, 9);
  spool->Acknowledge(kLeft, 1000);
  Kill(spool, files);

  spool = OpenSpool(files);
  const auto streams = spool->Streams();
  ASSERT_THAT(streams, SizeIs(2));
  ASSERT_TRUE(streams[0].end && streams[1].end);
  EXPECT_TRUE(streams[0].end->interrupted);
  EXPECT_EQ(streams[0].end->last_seq, 2500u);
  EXPECT_EQ(streams[1].end->last_seq, 9u);
  EXPECT_FALSE(streams[0].is_of_other_boot);
  // Whether the acknowledgement is known depends on the last checkpoint.
  const ReadStreamRows left = ReadRows(*spool, kLeft, streams[0].durable_seq + 1);
  EXPECT_EQ(left.rows.size(), 2500u - streams[0].durable_seq);
  EXPECT_THAT(left.dropped, IsEmpty());
  EXPECT_THAT(ReadRows(*spool, kRight, 5).rows, SizeIs(5));
  EXPECT_THAT(spool->Append(kLeft, MakeObservation(1), {}),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("has ended")));
  // New observations are of a new stream.
  ASSERT_THAT(spool->Open({"s-1", "left", 4}, 1, 1), IsOk());
  AppendRows(*spool, {"s-1", "left", 4}, 1, 10);
  Kill(spool, files);
  spool = OpenSpool(files);
  EXPECT_THAT(spool->Streams(), SizeIs(3));
  EXPECT_THAT(ReadRows(*spool, {"s-1", "left", 4}, 1).rows, SizeIs(10));
}

TEST(DiskSpool, KeepsTheEndOfACaptureWithItsReport) {
  ModelFileSystem files;
  auto spool = OpenSpool(files);
  ASSERT_THAT(spool->Open(kLeft, 1, 1), IsOk());
  ASSERT_THAT(spool->Open(kRight, 1, 1), IsOk());
  AppendRows(*spool, kLeft, 1, 10);
  CameraReport report;
  report.refused = {{"", RefusalReason::kCsvBadTime, 2, "f.csv:1"}};
  ASSERT_THAT(spool->Finish(kLeft, report), IsOk());
  ASSERT_THAT(spool->Finish(kRight, {}), IsOk());
  spool->Maintain();
  Kill(spool, files);
  spool = OpenSpool(files);
  const auto left = spool->Find(kLeft);
  const auto right = spool->Find(kRight);
  ASSERT_TRUE(left && left->end && right && right->end);
  EXPECT_FALSE(left->end->interrupted);
  EXPECT_EQ(left->end->last_seq, 10u);
  EXPECT_EQ(left->end->report.observation_count, 10u);
  EXPECT_EQ(left->end->report.refused, report.refused);
  EXPECT_EQ(right->end->last_seq, 0u);
  EXPECT_FALSE(right->end->interrupted);
}

TEST(DiskSpool, ForgetsADiscardedStreamForGood) {
  ModelFileSystem files;
  auto spool = OpenSpool(files);
  ASSERT_THAT(spool->Open(kLeft, 1, 1), IsOk());
  AppendRows(*spool, kLeft, 1, 100);
  EXPECT_EQ(spool->Discard(kLeft), 100u);
  spool->Maintain();
  // The same name again is another stream.
  ASSERT_THAT(spool->Open(kLeft, 1, 1), IsOk());
  AppendRows(*spool, kLeft, 1, 3);
  Kill(spool, files);
  spool = OpenSpool(files);
  ASSERT_THAT(spool->Streams(), SizeIs(1));
  EXPECT_THAT(ReadRows(*spool, kLeft, 1).rows, SizeIs(3));
  EXPECT_EQ(spool->Discard(kLeft), 3u);
  spool->Maintain();
  Kill(spool, files);
  spool = OpenSpool(files);
  EXPECT_THAT(spool->Streams(), IsEmpty());
  EXPECT_EQ(SegmentCount(files), 0u);
}

TEST(DiskSpool, SaysThatAStreamIsOfAnotherRunOfTheOperatingSystem) {
  ModelFileSystem files;
  auto spool = OpenSpool(files);
  ASSERT_THAT(spool->Open(kLeft, 1, 1), IsOk());
  AppendRows(*spool, kLeft, 1, 3);
  Kill(spool, files);
  DiskSpoolOptions options = ModelOptions();
  options.boot = 8;
  spool = OpenSpool(files, options);
  EXPECT_TRUE(spool->Find(kLeft)->is_of_other_boot);
}

TEST(DiskSpool, ReadsHeadersAndLastSegmentsOnlyWhenItIsOpened) {
  ModelFileSystem files;
  DiskSpoolOptions options = ModelOptions();
  options.limit_bytes = uint64_t{64} << 20;
  auto spool = OpenSpool(files, options);
  ASSERT_THAT(spool->Open(kLeft, 1, 1), IsOk());
  AppendRows(*spool, kLeft, 1, 200'000);
  EXPECT_GT(files.bytes(), uint64_t{12} << 20);
  Kill(spool, files);
  const uint64_t before = files.bytes_read();
  spool = OpenSpool(files, options);
  EXPECT_LT(files.bytes_read() - before, uint64_t{5} << 20) << "more than one segment of 4 MiB";
  EXPECT_EQ(spool->Find(kLeft)->end_seq, 200'001u);
}

TEST(DiskSpool, SyncsWhatWasAppendedWhenItIsTold) {
  ModelFileSystem files;
  const auto spool = OpenSpool(files);
  ASSERT_THAT(spool->Open(kLeft, 1, 1), IsOk());
  AppendRows(*spool, kLeft, 1, 10);
  EXPECT_EQ(spool->Find(kLeft)->synced_seq, 0u);
  spool->Maintain();
  EXPECT_EQ(spool->Find(kLeft)->synced_seq, 10u);
  DiskSpoolOptions options = ModelOptions();
  options.sync_interval = std::chrono::milliseconds(0);
  ModelFileSystem others;
  const auto careful = OpenSpool(others, options);
  ASSERT_THAT(careful->Open(kLeft, 1, 1), IsOk());
  AppendRows(*careful, kLeft, 1, 10);
  EXPECT_EQ(careful->Find(kLeft)->synced_seq, 10u);
}

TEST(DiskSpool, DropsTheOldestWhenItIsFullAndCountsThem) {
  ModelFileSystem files;
  DiskSpoolOptions options = ModelOptions();
  options.limit_bytes = uint64_t{256} << 10;
  options.full = SpoolFull::kDropOldest;
  auto spool = OpenSpool(files, options);
  ASSERT_THAT(spool->Open(kRight, 1, 1), IsOk());
  AppendRows(*spool, kRight, 1, 100);
  ASSERT_THAT(spool->Open(kLeft, 1, 1), IsOk());
  AppendRows(*spool, kLeft, 1, 10'000);
  EXPECT_LE(spool->Status().bytes, options.limit_bytes);
  const ReadStreamRows left = ReadRows(*spool, kLeft, 1);
  EXPECT_EQ(left.rows.size() + left.dropped.size(), 10'000u);
  EXPECT_TRUE(left.rows.contains(10'000));
  EXPECT_GT(left.rows.size(), 1000u);
  for (const auto& [seq, reason] : left.dropped) {
    ASSERT_EQ(reason, RefusalReason::kSpoolFull) << seq;
  }
  // Those of the other stream were older.
  EXPECT_THAT(ReadRows(*spool, kRight, 1).rows, IsEmpty());
  const uint64_t dropped = left.dropped.size() + 100;
  ASSERT_THAT(spool->Status().dropped, SizeIs(1));
  EXPECT_EQ(spool->Status().dropped[0].count, dropped);
  EXPECT_EQ(spool->Find(kLeft)->row_count, left.rows.size());
  Kill(spool, files);
  spool = OpenSpool(files, options);
  EXPECT_EQ(ReadRows(*spool, kLeft, 1).rows, left.rows);
  EXPECT_EQ(spool->Status().dropped[0].count, dropped);
}

TEST(DiskSpool, MakesAppendWaitWhileItIsFull) {
  const testing::TemporaryDirectory directory;
  DiskSpoolOptions options;
  options.folder = (directory.path() / "spool").string();
  options.limit_bytes = uint64_t{256} << 10;
  options.sync_interval = std::chrono::milliseconds(5);
  const auto spool = DiskSpool::Create(options);
  ASSERT_THAT(spool, IsOk());
  ASSERT_THAT((*spool)->Open(kLeft, 1, 1), IsOk());
  ASSERT_THAT((*spool)->Open(kRight, 1, 1), IsOk());
  std::thread left([&] { AppendRows(**spool, kLeft, 1, 20'000); });
  std::thread right([&] { AppendRows(**spool, kRight, 1, 20'000); });
  uint32_t next_left = 1, next_right = 1;
  const auto take = [&](const StreamKey& stream, uint32_t* next) {
    const auto batch = (*spool)->Read(stream, *next, 256);
    ASSERT_THAT(batch, IsOk());
    ASSERT_THAT(batch->dropped, IsEmpty());
    for (size_t row = 0; row < batch->rows(); ++row) {
      ASSERT_EQ(batch->time_ns[row], (*next + static_cast<int64_t>(row)) * kRowNs);
    }
    *next = batch->end_seq();
    (*spool)->Acknowledge(stream, *next - 1);
  };
  while (next_left <= 20'000 || next_right <= 20'000) {
    ASSERT_LE((*spool)->Status().bytes, options.limit_bytes);
    ASSERT_NO_FATAL_FAILURE(take(kLeft, &next_left));
    ASSERT_NO_FATAL_FAILURE(take(kRight, &next_right));
  }
  left.join();
  right.join();
  EXPECT_EQ((*spool)->Status().row_count, 0u);
}

TEST(DiskSpool, EndsAWaitingAppendWhenTheStreamIsDiscardedOrTheAgentEnds) {
  ModelFileSystem files;
  DiskSpoolOptions options = ModelOptions();
  options.limit_bytes = 1;
  options.has_thread = true;
  const auto spool = OpenSpool(files, options);
  ASSERT_THAT(spool->Open(kLeft, 1, 1), IsOk());
  ASSERT_THAT(spool->Open(kRight, 1, 1), IsOk());
  AppendRows(*spool, kRight, 1, 1);  // an empty spool takes any row
  std::thread discarded([&] {
    EXPECT_THAT(spool->Append(kLeft, MakeObservation(1), {}),
                StatusIs(absl::StatusCode::kNotFound, _));
  });
  spool->Discard(kLeft);
  discarded.join();
  std::thread ended([&] {
    EXPECT_THAT(spool->Append(kRight, MakeObservation(1), {}),
                StatusIs(absl::StatusCode::kCancelled, _));
  });
  spool->Shutdown();
  ended.join();
  EXPECT_THAT(ReadRows(*spool, kRight, 1).rows, SizeIs(1));
}

}  // namespace
}  // namespace rigcal::agent::disk_spool_test

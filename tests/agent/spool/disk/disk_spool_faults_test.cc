// SPDX-License-Identifier: Apache-2.0
// Every call that changes the disk fails once, or from then on: full disks and broken ones.
#include <gmock/gmock.h>

#include <chrono>
#include <string>

#include "tests/agent/spool/disk/spool_reading.h"
#include "tests/testing/process.h"

namespace rigcal::agent::disk_spool_faults_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

const StreamKey kLeft{"s-1", "left", 3};

DiskSpoolOptions SmallOptions(SpoolFull full = SpoolFull::kDropOldest) {
  DiskSpoolOptions options = ModelOptions();
  options.limit_bytes = uint64_t{256} << 10;
  options.full = full;
  return options;
}

struct Outcome {
  bool opened = false;
  uint32_t appended = 0;
  uint32_t acknowledged = 0;
  absl::Status append_status;
};

Outcome Drive(ModelFileSystem& files, std::unique_ptr<DiskSpool>* spool) {
  Outcome outcome;
  auto created = DiskSpool::Create(SmallOptions(), &files);
  if (!created.ok()) return outcome;
  *spool = *std::move(created);
  outcome.append_status = (*spool)->Open(kLeft, 1, 1);
  if (!outcome.append_status.ok()) return outcome;
  outcome.opened = true;
  for (uint32_t seq = 1; seq <= 800; ++seq) {
    const auto given = (*spool)->Append(kLeft, MakeObservation(seq * kRowNs), {});
    if (!given.ok()) {
      outcome.append_status = given.status();
      break;
    }
    outcome.appended = seq;
    if (seq % 50 == 0) (*spool)->Maintain();
    if (seq % 300 == 0) {
      outcome.acknowledged = seq - 200;
      (*spool)->Acknowledge(kLeft, outcome.acknowledged);
    }
  }
  (*spool)->Maintain();
  return outcome;
}

int CallsOfARun() {
  ModelFileSystem files;
  std::unique_ptr<DiskSpool> spool;
  EXPECT_EQ(Drive(files, &spool).appended, 800u);
  return files.calls();
}

// Everything that Append took is there, sent or counted as dropped, now and after a restart.
void ExpectAllAccountedFor(ObservationSpool& spool, const Outcome& outcome) {
  const auto spooled = spool.Find(kLeft);
  if (!spooled) {
    EXPECT_EQ(outcome.appended, outcome.acknowledged);
    return;
  }
  const ReadStreamRows read = ReadRows(spool, kLeft, spooled->durable_seq + 1);
  for (uint32_t seq = outcome.acknowledged + 1; seq <= outcome.appended; ++seq) {
    const auto dropped = read.dropped.find(seq);
    ASSERT_TRUE(read.rows.contains(seq) ||
                (dropped != read.dropped.end() && dropped->second == RefusalReason::kSpoolFull))
        << seq;
  }
  EXPECT_EQ(spooled->row_count, read.rows.size());
}

TEST(DiskSpoolFaults, SurvivesAFullDiskAtAnyCallWithoutLosingARow) {
  const int calls = CallsOfARun();
  ASSERT_GT(calls, 700);
  for (int call = 1; call <= calls; ++call) {
    SCOPED_TRACE(call);
    ModelFileSystem files;
    std::unique_ptr<DiskSpool> spool;
    files.FailAt(call, absl::StatusCode::kResourceExhausted);
    const Outcome outcome = Drive(files, &spool);
    ASSERT_FALSE(files.synced_again());
    if (spool == nullptr) continue;  // it says so at its start
    // A failed sync ends it; a failed write does not.
    if (!outcome.append_status.ok()) {
      ASSERT_EQ(outcome.append_status.code(), absl::StatusCode::kDataLoss);
    }
    ASSERT_NO_FATAL_FAILURE(ExpectAllAccountedFor(*spool, outcome));
    Kill(spool, files);
    spool = OpenSpool(files, SmallOptions());
    ASSERT_NO_FATAL_FAILURE(ExpectAllAccountedFor(*spool, outcome));
  }
}

TEST(DiskSpoolFaults, StopsAcceptingAfterAnErrorAtAnyCallAndNeverSyncsAgain) {
  const int calls = CallsOfARun();
  for (int call = 1; call <= calls; ++call) {
    SCOPED_TRACE(call);
    ModelFileSystem files;
    std::unique_ptr<DiskSpool> spool;
    files.FailAt(call, absl::StatusCode::kInternal);
    const Outcome outcome = Drive(files, &spool);
    ASSERT_FALSE(files.synced_again());
    if (spool == nullptr) continue;
    if (!outcome.append_status.ok()) {
      ASSERT_EQ(outcome.append_status.code(), absl::StatusCode::kDataLoss);
      ASSERT_THAT(spool->Status().problem, HasSubstr("start the agent again"));
    }
    // What it holds is still sent.
    ASSERT_NO_FATAL_FAILURE(ExpectAllAccountedFor(*spool, outcome));
    Kill(spool, files);
    spool = OpenSpool(files, SmallOptions());
    ASSERT_THAT(spool->Status().problem, IsEmpty());
    ASSERT_NO_FATAL_FAILURE(ExpectAllAccountedFor(*spool, outcome));
  }
}

TEST(DiskSpoolFaults, EndsAtADiskThatIsBrokenFromAnyCallOn) {
  const int calls = CallsOfARun();
  for (int call = 1; call <= calls; call += 7) {
    SCOPED_TRACE(call);
    ModelFileSystem files;
    std::unique_ptr<DiskSpool> spool;
    files.FailAt(call, absl::StatusCode::kInternal, /*forever=*/true);
    const Outcome outcome = Drive(files, &spool);
    ASSERT_FALSE(files.synced_again());
    if (spool != nullptr && outcome.opened && outcome.appended < 800) {
      ASSERT_EQ(outcome.append_status.code(), absl::StatusCode::kDataLoss);
    }
    ASSERT_LT(files.calls(), 2 * calls) << "it tries again and again";
  }
}

TEST(DiskSpoolFaults, FreesSpaceOnADiskThatIsFull) {
  ModelFileSystem files;
  auto spool = OpenSpool(files, SmallOptions());
  ASSERT_THAT(spool->Open(kLeft, 1, 1), IsOk());
  AppendRows(*spool, kLeft, 1, 1000);
  spool->Maintain();
  // Others have taken the rest of the disk; not even a checkpoint fits.
  files.SetCapacity(files.bytes());
  spool->Acknowledge(kLeft, 900);
  const uint64_t before = spool->Status().bytes;
  spool->Maintain();
  EXPECT_LT(spool->Status().bytes, before);
  AppendRows(*spool, kLeft, 1001, 1500);
  const ReadStreamRows read = ReadRows(*spool, kLeft, 901);
  EXPECT_EQ(read.rows.size() + read.dropped.size(), 600u);
  EXPECT_TRUE(read.rows.contains(1500));
}

TEST(DiskSpoolFaults, CountsRowsThatADiskWithoutAnyRoomCannotTake) {
  ModelFileSystem files;
  auto spool = OpenSpool(files, SmallOptions());
  ASSERT_THAT(spool->Open(kLeft, 1, 1), IsOk());
  spool->Maintain();
  files.SetCapacity(0);
  AppendRows(*spool, kLeft, 1, 100);
  EXPECT_THAT(spool->Status().problem, HasSubstr("full"));
  ASSERT_THAT(spool->Status().dropped, SizeIs(1));
  EXPECT_EQ(spool->Status().dropped[0].count, 100u);
  files.SetCapacity(uint64_t{1} << 30);
  AppendRows(*spool, kLeft, 101, 200);
  EXPECT_THAT(spool->Status().problem, IsEmpty());
  const ReadStreamRows read = ReadRows(*spool, kLeft, 1);
  EXPECT_EQ(read.dropped.size(), 100u);
  EXPECT_EQ(read.rows.size(), 100u);
  EXPECT_TRUE(read.rows.contains(101));
}

TEST(DiskSpoolFaults, SaysWhyItCannotBeOpened) {
  ModelFileSystem files;
  files.FailAt(1, absl::StatusCode::kInternal, /*forever=*/true);
  EXPECT_THAT(DiskSpool::Create(SmallOptions(), &files),
              StatusIs(absl::StatusCode::kInternal, HasSubstr("the model fails")));
}

TEST(DiskSpoolFaults, ItsThreadSurvivesWhatIsThrownAndSaysThatItHasFailed) {
  ModelFileSystem files;
  DiskSpoolOptions options = ModelOptions();
  options.has_thread = true;
  options.sync_interval = std::chrono::milliseconds(1);
  std::unique_ptr<DiskSpool> spool = OpenSpool(files, options);
  ASSERT_THAT(spool->Open(kLeft, 1, 1), IsOk());
  ASSERT_NO_FATAL_FAILURE(AppendRows(*spool, kLeft, 1, 10));
  // The next change of the disk is the thread's: a sync or a checkpoint.
  files.ThrowAt(1);
  spool->Acknowledge(kLeft, 1);
  ASSERT_TRUE(::rigcal::testing::WaitFor([&] { return !spool->Status().problem.empty(); }));
  EXPECT_THAT(spool->Append(kLeft, MakeObservation(kRowNs), {}),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("accepts nothing any more")));
  EXPECT_THAT(spool->Status().problem, HasSubstr("bad_alloc"));
  // What it holds is still sent.
  const auto batch = spool->Read(kLeft, 2, 10);
  ASSERT_THAT(batch, IsOk());
  EXPECT_EQ(batch->rows(), 9u);
}

}  // namespace
}  // namespace rigcal::agent::disk_spool_faults_test

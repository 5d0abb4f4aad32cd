// SPDX-License-Identifier: Apache-2.0
// A flipped bit loses at most the record that it is in, is counted, and everything else is read.

#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "server/store/sqlite/database_check.h"
#include "server/store/sqlite/sqlite_store.h"
#include "tests/server/store/store_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::damaged_records_test {
namespace {

using ::rigcal::testing::CapturingSession;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::KeyOf;
using ::rigcal::testing::MakeBatch;
using ::rigcal::testing::ReadRows;
using ::rigcal::testing::RowKey;
using ::rigcal::testing::StatusIs;
using ::testing::_;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr uint32_t kBatches = 50;  // of each of two cameras
constexpr uint32_t kRows = 7;      // of each batch

class DamagedRecords : public ::rigcal::testing::StoreFixture {
 protected:
  void SetUp() override {
    StoreFixture::SetUp();
    ASSERT_THAT(store().CreateSession(CapturingSession({"a", "b"})), IsOk());
    for (uint32_t i = 0; i < kBatches; ++i) {
      for (const char* camera : {"a", "b"}) {
        Append(MakeBatch(KeyOf(camera), 1 + kRows * i, kRows * (i + 1)));
      }
    }
    all_rows_ = ReadRows(store());
    ASSERT_EQ(all_rows_.size(), 2 * kBatches * kRows);
  }

  std::filesystem::path File() const { return folder() / "rigcal.db"; }
  // With the store closed.
  int Execute(const std::string& sql) {
    SQLite::Database database(File().string(), SQLite::OPEN_READWRITE);
    return database.exec(sql);
  }
  std::vector<int64_t> BatchIds() {
    SQLite::Database database(File().string(), SQLite::OPEN_READONLY);
    SQLite::Statement row(database, "SELECT id FROM batch ORDER BY id");
    std::vector<int64_t> ids;
    while (row.executeStep()) ids.push_back(row.getColumn(0).getInt64());
    return ids;
  }
  // Flips one bit of each of these batches; the same call again heals them.
  void FlipBits(const std::vector<int64_t>& ids, uint32_t seed) {
    std::mt19937 random(seed);
    SQLite::Database database(File().string(), SQLite::OPEN_READWRITE);
    SQLite::Transaction transaction(database);
    for (const int64_t id : ids) {
      SQLite::Statement read(database, "SELECT body FROM batch WHERE id=?");
      read.bind(1, id);
      read.executeStep();
      std::string body = read.getColumn(0).getString();
      const size_t bit = random() % (body.size() * 8);
      body[bit / 8] = static_cast<char>(body[bit / 8] ^ (1 << (bit % 8)));
      SQLite::Statement write(database, "UPDATE batch SET body=? WHERE id=?");
      write.bind(1, body.data(), static_cast<int>(body.size()));
      write.bind(2, id);
      write.exec();
    }
    transaction.commit();
  }
  void ForgetNotes() { Execute("DELETE FROM damaged_batch"); }

  uint64_t DamagedCount(size_t camera) {
    const auto counts = store().GetSessionCounts("s-test");
    EXPECT_THAT(counts, IsOk());
    for (const Refusal& refusal : counts->at(camera).refused) {
      if (refusal.reason == RefusalReason::kDamagedRecord) return refusal.count;
    }
    return 0;
  }

  std::vector<std::pair<RowKey, testing::StoredRow>> all_rows_;
};

TEST_F(DamagedRecords, OneFlippedBitLosesTheRowsOfItsBatchOnly) {
  Close();
  const std::vector<int64_t> ids = BatchIds();
  ASSERT_EQ(ids.size(), 100u);
  for (size_t i = 0; i < ids.size() && !HasFailure(); ++i) {
    SCOPED_TRACE(::testing::Message() << "batch " << ids[i]);
    FlipBits({ids[i]}, static_cast<uint32_t>(i));
    Open();
    const uint32_t first = static_cast<uint32_t>(ids[i] & 0xffffffff);
    const bool of_b = i >= kBatches;
    auto expected = all_rows_;
    std::erase_if(expected, [&](const auto& row) {
      const auto& [camera, epoch, seq] = row.first;
      return camera == (of_b ? "b" : "a") && seq >= first && seq < first + kRows;
    });
    EXPECT_TRUE(ReadRows(store()) == expected);
    EXPECT_EQ(DamagedCount(0), of_b ? 0 : kRows);
    EXPECT_EQ(DamagedCount(1), of_b ? kRows : 0);
    EXPECT_TRUE(ReadRows(store()) == expected);
    EXPECT_EQ(DamagedCount(0) + DamagedCount(1), kRows) << "counted once";
    Close();
    FlipBits({ids[i]}, static_cast<uint32_t>(i));
    ForgetNotes();
  }
  Open();
  EXPECT_TRUE(ReadRows(store()) == all_rows_);
}

TEST_F(DamagedRecords, FlippedBitsInHalfOfTheBatchesLoseTheirRows) {
  Close();
  std::vector<int64_t> ids = BatchIds();
  std::shuffle(ids.begin(), ids.end(), std::mt19937(3));
  ids.resize(50);
  FlipBits(ids, 4);
  Open();
  EXPECT_EQ(ReadRows(store()).size(), 50 * kRows);
  EXPECT_EQ(DamagedCount(0) + DamagedCount(1), 50 * kRows);
  // The camera alone, and a new process, count the same.
  Reopen();
  EXPECT_EQ(DamagedCount(0) + DamagedCount(1), 50 * kRows);
  ASSERT_OK_AND_ASSIGN(const DatabaseReport report, CheckDatabase(File(), [](double) {}));
  EXPECT_EQ(report.fault_count, 50u);
  EXPECT_EQ(report.damaged_row_count, 50 * kRows);
  EXPECT_EQ(report.observation_count, 50 * kRows);
}

TEST_F(DamagedRecords, AllBatchesDamagedIsAnEmptySession) {
  Close();
  FlipBits(BatchIds(), 5);
  Open();
  EXPECT_TRUE(ReadRows(store()).empty());
  EXPECT_EQ(DamagedCount(0) + DamagedCount(1), 2 * kBatches * kRows);
}

TEST_F(DamagedRecords, NamesTheDamagedBatch) {
  Close();
  FlipBits({BatchIds()[kBatches + 3]}, 1);
  Open();
  std::string damage;
  ASSERT_THAT(store().ReadObservations("s-test", "b",
                                       [&](StoredBatch stored) {
                                         damage += stored.damage;
                                         return absl::OkStatus();
                                       }),
              IsOk());
  EXPECT_THAT(damage,
              AllOf(HasSubstr("session s-test"), HasSubstr("camera b"), HasSubstr("stream epoch 1"),
                    HasSubstr(absl::StrCat("from seq ", 1 + 3 * kRows))));
}

TEST_F(DamagedRecords, AnAuditReadsTheRowsAndSaysWhichAreDamaged) {
  Close();
  const std::vector<int64_t> ids = BatchIds();
  FlipBits({ids[3], ids[4], ids[10], ids[kBatches]}, 1);
  Open();
  // The numbers of rows beside the records have no checksum, and prove nothing.
  ASSERT_OK_AND_ASSIGN(const auto audits, store().AuditStreams("s-test"));
  ASSERT_EQ(audits.size(), 2u);
  EXPECT_EQ(audits[0].stored_count, (kBatches - 3) * kRows);
  EXPECT_EQ(audits[0].damaged_count, 3 * kRows);
  EXPECT_THAT(audits[0].damaged,
              ::testing::ElementsAre(StreamAudit::Range{1 + 3 * kRows, 2 * kRows},
                                     StreamAudit::Range{1 + 10 * kRows, kRows}));
  EXPECT_THAT(audits[0].damage, HasSubstr("camera a"));
  EXPECT_EQ(audits[0].absent_count, 0u);
  EXPECT_EQ(audits[1].damaged_count, kRows);
  EXPECT_EQ(audits[1].stored_count + audits[1].damaged_count, kBatches * kRows);
  // The camera's counts know it from then on.
  EXPECT_EQ(DamagedCount(0), 3 * kRows);
}

TEST_F(DamagedRecords, AnAuditMissesRecordsThatAreGone) {
  Close();
  const std::vector<int64_t> ids = BatchIds();
  EXPECT_EQ(Execute(absl::StrCat("DELETE FROM batch WHERE id=", ids[7])), 1);
  EXPECT_EQ(Execute(absl::StrCat("UPDATE batch SET row_count=900 WHERE id=", ids[kBatches - 1])),
            1);
  Open();
  ASSERT_OK_AND_ASSIGN(const auto audits, store().AuditStreams("s-test"));
  EXPECT_EQ(audits[0].stored_count, (kBatches - 1) * kRows);
  EXPECT_EQ(audits[0].highest_seq, kBatches * kRows);
  EXPECT_THAT(audits[0].absent, ::testing::ElementsAre(StreamAudit::Range{1 + 7 * kRows, kRows}));
}

TEST_F(DamagedRecords, RepeatedRowsOfADamagedBatchAreNoConflict) {
  Close();
  FlipBits({BatchIds()[0]}, 1);
  Open();
  const AppendOutcome outcome = Append(MakeBatch(KeyOf("a"), 1, kRows));
  EXPECT_EQ(outcome.duplicate_rows, kRows);
  EXPECT_EQ(outcome.conflict_rows, 0u);
}

// Bytes of the file itself: a page of the tree that batches are in becomes unreadable.
TEST_F(DamagedRecords, ADamagedPageLosesWhatIsOnIt) {
  Close();
  std::string bytes;
  {
    std::ifstream file(File(), std::ios::binary);
    bytes.assign(std::istreambuf_iterator<char>(file), {});
  }
  constexpr size_t kPage = 4096;
  const size_t middle = bytes.find("RGOB", bytes.size() / 2);
  ASSERT_NE(middle, std::string::npos);
  const size_t page = middle / kPage;
  size_t batches_on_page = 0;
  for (size_t at = bytes.find("RGOB", page * kPage); at < (page + 1) * kPage;
       at = bytes.find("RGOB", at + 1)) {
    ++batches_on_page;
  }
  ASSERT_GT(batches_on_page, 0u);
  {
    std::fstream file(File(), std::ios::binary | std::ios::in | std::ios::out);
    file.seekp(static_cast<std::streamoff>(page * kPage));
    file.write("\x55", 1);  // no kind of page
  }
  Open();
  const size_t lost = batches_on_page * kRows;
  EXPECT_EQ(ReadRows(store()).size(), all_rows_.size() - lost);
  EXPECT_EQ(DamagedCount(0) + DamagedCount(1), lost);
  ASSERT_OK_AND_ASSIGN(const auto audits, store().AuditStreams("s-test"));
  uint64_t readable = 0, damaged = 0;
  for (const StreamAudit& audit : audits) {
    readable += audit.stored_count;
    damaged += audit.damaged_count;
  }
  EXPECT_EQ(readable, all_rows_.size() - lost);
  EXPECT_EQ(damaged, lost);
  ASSERT_OK_AND_ASSIGN(const DatabaseReport report, CheckDatabase(File(), [](double) {}));
  EXPECT_GT(report.fault_count, 0u);
}

TEST_F(DamagedRecords, ListsNameADamagedSessionAndGoOn) {
  Session other = CapturingSession({"c"});
  other.id = "other";
  other.title = "intact";
  ASSERT_THAT(store().CreateSession(other), IsOk());
  Close();
  EXPECT_EQ(Execute("UPDATE session SET body=body||x'00' WHERE id='s-test'"), 1);
  Open();
  EXPECT_THAT(store().GetSession("s-test"),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("session s-test")));
  ASSERT_OK_AND_ASSIGN(const auto sessions, store().ListSessions({}, {.limit = 10}));
  ASSERT_EQ(sessions.size(), 2u);
  EXPECT_EQ(sessions[0].record.session.title, "intact");
  EXPECT_EQ(sessions[0].record.damage, "");
  EXPECT_EQ(sessions[1].record.session.id, "s-test");
  EXPECT_THAT(sessions[1].record.damage, AllOf(HasSubstr("session s-test"), HasSubstr("backup")));
  EXPECT_EQ(sessions[1].record.observation_count, 2 * kBatches * kRows);
  EXPECT_THAT(store().DeleteSession("s-test"), IsOk());
}

TEST_F(DamagedRecords, ADamagedSummaryIsMadeFromTheRecord) {
  Close();
  EXPECT_EQ(Execute("UPDATE session_summary SET checksum=checksum+1"), 1);
  Open();
  ASSERT_OK_AND_ASSIGN(auto sessions, store().ListSessions({}, {.limit = 10}));
  ASSERT_EQ(sessions.size(), 1u);
  EXPECT_EQ(sessions[0].record.damage, "");
  EXPECT_EQ(sessions[0].record.session.rig, "rig");
  EXPECT_EQ(sessions[0].record.camera_count, 2u);
  Close();
  EXPECT_EQ(Execute("UPDATE session SET checksum=checksum+1"), 1);
  Open();
  ASSERT_OK_AND_ASSIGN(sessions, store().ListSessions({.rig = "rig"}, {.limit = 10}));
  ASSERT_EQ(sessions.size(), 1u);
  EXPECT_EQ(sessions[0].record.session.id, "s-test");
  EXPECT_EQ(sessions[0].record.session.state, SessionState::kCapturing);
  EXPECT_THAT(sessions[0].record.damage, HasSubstr("checksum"));
}

TEST_F(DamagedRecords, ListsNameADamagedCalibration) {
  Calibration calibration;
  calibration.rig = "rig";
  for (int i = 0; i < 3; ++i) ASSERT_THAT(store().CreateCalibration(calibration), IsOk());
  Close();
  Execute("UPDATE calibration SET checksum=checksum+1 WHERE id='c-000001'");
  Execute("UPDATE calibration_summary SET body=x'00' WHERE record_number IN (1, 2)");
  Open();
  EXPECT_THAT(store().GetCalibration("c-000001"),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("calibration c-000001")));
  ASSERT_OK_AND_ASSIGN(const auto listed, store().ListCalibrations({}, {.limit = 10}));
  ASSERT_EQ(listed.size(), 3u);
  EXPECT_EQ(listed[0].record.damage, "");
  EXPECT_EQ(listed[1].record.damage, "");
  EXPECT_EQ(listed[2].record.id, "c-000001");
  EXPECT_EQ(listed[2].record.version, 1u);
  EXPECT_THAT(listed[2].record.damage, HasSubstr("calibration c-000001"));
}

}  // namespace
}  // namespace rigcal::server::damaged_records_test

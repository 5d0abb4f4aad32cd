// SPDX-License-Identifier: Apache-2.0
// A database of version 3, 4 or 5 is brought up to date without losing anything.

#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/store/sqlite/database_check.h"
#include "server/store/sqlite/sqlite_schema.h"
#include "server/store/sqlite/sqlite_store.h"
#include "tests/server/store/store_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::schema_migration_test {
namespace {

using ::rigcal::testing::CapturingSession;
using ::rigcal::testing::CountsText;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::KeyOf;
using ::rigcal::testing::MakeBatch;
using ::rigcal::testing::ReadRows;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

class SchemaMigration : public ::rigcal::testing::StoreFixture {
 protected:
  std::filesystem::path File() const { return folder() / "rigcal.db"; }
  // What versions 4 to 7 have added is taken away again.
  void MakeVersion3() {
    SQLite::Database database(File().string(), SQLite::OPEN_READWRITE);
    database.exec(
        "DROP TABLE calibration_job; DROP TABLE calibration_worker; DROP TABLE light_sample; DROP "
        "TABLE activation; DROP TABLE session_summary; DROP TABLE calibration_summary; DROP TABLE "
        "damaged_batch; "
        "PRAGMA user_version=3; PRAGMA auto_vacuum=NONE; VACUUM");
  }
  // What versions 5 to 7 have added is taken away again.
  void MakeVersion4() {
    SQLite::Database database(File().string(), SQLite::OPEN_READWRITE);
    database.exec(
        "DROP TABLE calibration_job; DROP TABLE calibration_worker; DROP TABLE light_sample; DROP "
        "TABLE activation; PRAGMA user_version=4");
  }
  // What versions 6 and 7 have added is taken away again.
  void MakeVersion5() {
    SQLite::Database database(File().string(), SQLite::OPEN_READWRITE);
    database.exec(
        "DROP TABLE calibration_job; DROP TABLE calibration_worker; DROP TABLE light_sample; "
        "PRAGMA user_version=5");
  }
  int Version() {
    SQLite::Database database(File().string(), SQLite::OPEN_READONLY);
    return database.execAndGet("PRAGMA user_version").getInt();
  }
};

TEST_F(SchemaMigration, KeepsEverythingAndMakesSummaries) {
  Session session = CapturingSession({"a", "b"});
  session.title = "before";
  ASSERT_THAT(store().CreateSession(session), IsOk());
  Append(MakeBatch(KeyOf("a"), 1, 20));
  Append(MakeBatch(KeyOf("b"), 11, 20));
  Calibration calibration;
  calibration.rig = "rig";
  calibration.session_ids = {"s-test"};
  ASSERT_THAT(store().CreateCalibration(calibration), IsOk());
  const auto rows = ReadRows(store());
  const std::string counts = CountsText(store());
  const std::string id = store().server_id();
  Close();
  MakeVersion3();
  ASSERT_EQ(Version(), 3);
  EXPECT_THAT(CheckDatabase(File(), [](double) {}),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("up to date")));

  Open();
  EXPECT_EQ(Version(), static_cast<int>(kSchemaVersion));
  EXPECT_EQ(store().server_id(), id);
  EXPECT_TRUE(ReadRows(store()) == rows);
  EXPECT_EQ(CountsText(store()), counts);
  ASSERT_OK_AND_ASSIGN(const auto sessions, store().ListSessions({}, {.limit = 5}));
  ASSERT_EQ(sessions.size(), 1u);
  EXPECT_EQ(sessions[0].record.session.title, "before");
  EXPECT_EQ(sessions[0].record.observation_count, 30u);
  ASSERT_OK_AND_ASSIGN(const auto calibrations, store().ListCalibrations({}, {.limit = 5}));
  ASSERT_EQ(calibrations.size(), 1u);
  EXPECT_EQ(calibrations[0].record.session_ids, calibration.session_ids);
  ASSERT_OK_AND_ASSIGN(const DatabaseReport report, CheckDatabase(File(), [](double) {}));
  EXPECT_EQ(report.fault_count, 0u);
  // And is written on.
  EXPECT_EQ(Append(MakeBatch(KeyOf("a"), 1, 25)).stored_rows, 5u);
  EXPECT_THAT(store().Compact([](double) { return absl::OkStatus(); }), IsOk());
  EXPECT_EQ(ReadRows(store()).size(), 35u);
}

TEST_F(SchemaMigration, Version4GetsActivations) {
  Calibration calibration;
  calibration.rig = "rig";
  calibration.session_ids = {"s-test"};
  ASSERT_OK_AND_ASSIGN(calibration, store().CreateCalibration(calibration));
  Close();
  MakeVersion4();
  ASSERT_EQ(Version(), 4);
  EXPECT_THAT(CheckDatabase(File(), [](double) {}),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("up to date")));

  Open();
  EXPECT_EQ(Version(), static_cast<int>(kSchemaVersion));
  ASSERT_OK_AND_ASSIGN(const auto calibrations, store().ListCalibrations({}, {.limit = 5}));
  ASSERT_EQ(calibrations.size(), 1u);
  EXPECT_EQ(calibrations[0].record.id, calibration.id);
  ASSERT_OK_AND_ASSIGN(const auto none, store().ListActivations("rig", 5));
  EXPECT_TRUE(none.empty());
  Activation activation;
  activation.rig = "rig";
  activation.calibration_id = calibration.id;
  ASSERT_THAT(store().AddActivation(activation), IsOk());
  ASSERT_OK_AND_ASSIGN(const DatabaseReport report, CheckDatabase(File(), [](double) {}));
  EXPECT_EQ(report.fault_count, 0u);
}

TEST_F(SchemaMigration, Version5GetsReadingsOfLights) {
  ASSERT_THAT(store().CreateSession(CapturingSession({"a"})), IsOk());
  ObservationBatch before = MakeBatch(KeyOf("a"), 1, 5);
  before.clock_samples = {{.device_ns = 5, .host_monotonic_ns = 6, .host_utc_ns = 7}};
  Append(before);
  Close();
  MakeVersion5();
  ASSERT_EQ(Version(), 5);
  Open();
  EXPECT_EQ(Version(), static_cast<int>(kSchemaVersion));
  ObservationBatch after = MakeBatch(KeyOf("a"), 6, 9);
  after.clock_samples = {{.device_ns = 8, .uncertainty_ns = 9, .light = 3, .light_ns = 10}};
  EXPECT_EQ(Append(after).stored_rows, 4u);
  std::vector<ClockSample> samples;
  const auto visit = [&](StoredBatch stored) {
    for (const ClockSample& sample : stored.batch.clock_samples) samples.push_back(sample);
    return absl::OkStatus();
  };
  ASSERT_THAT(store().ReadObservations("s-test", "a", visit), IsOk());
  ASSERT_EQ(samples.size(), 2u);
  EXPECT_EQ(samples[0], before.clock_samples[0]);
  EXPECT_EQ(samples[1], after.clock_samples[0]);
}

TEST_F(SchemaMigration, Version6GetsItsUnfinishedCalibrationsQueued) {
  Calibration calibration;
  calibration.rig = "rig";
  calibration.session_ids = {"s-test"};
  ASSERT_OK_AND_ASSIGN(Calibration ended, store().CreateCalibration(calibration));
  ended.state = CalibrationState::kFailed;
  ASSERT_THAT(store().UpdateCalibration(ended), IsOk());
  ASSERT_OK_AND_ASSIGN(const Calibration waiting, store().CreateCalibration(calibration));
  Close();
  {
    SQLite::Database database(File().string(), SQLite::OPEN_READWRITE);
    database.exec(
        "DROP TABLE calibration_job; DROP TABLE calibration_worker; PRAGMA user_version=6");
  }
  Open();
  EXPECT_EQ(Version(), static_cast<int>(kSchemaVersion));
  ASSERT_THAT(store().AdoptJobs("1.0"), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto jobs, store().ListJobs());
  ASSERT_EQ(jobs.size(), 1u);
  EXPECT_EQ(jobs[0].calibration_id, waiting.id);
  EXPECT_EQ(jobs[0].software_version, "1.0");
}

TEST_F(SchemaMigration, ADamagedRecordStopsNothing) {
  ASSERT_THAT(store().CreateSession(CapturingSession({"a"})), IsOk());
  Close();
  MakeVersion3();
  {
    SQLite::Database database(File().string(), SQLite::OPEN_READWRITE);
    database.exec("UPDATE session SET checksum=checksum+1");
  }
  Open();
  ASSERT_OK_AND_ASSIGN(const auto sessions, store().ListSessions({}, {.limit = 5}));
  ASSERT_EQ(sessions.size(), 1u);
  EXPECT_EQ(sessions[0].record.session.id, "s-test");
  EXPECT_THAT(sessions[0].record.damage, HasSubstr("checksum is wrong"));
}

}  // namespace
}  // namespace rigcal::server::schema_migration_test

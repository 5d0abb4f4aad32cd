// SPDX-License-Identifier: Apache-2.0
#include "server/store/sqlite/sqlite_schema.h"

#include <map>
#include <random>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/status/status_macros.h"
#include "server/store/sql/calibration_table.h"
#include "server/store/sql/session_table.h"
#include "server/store/sqlite/sqlite_connection.h"

namespace rigcal::server {
namespace {

constexpr int32_t kApplicationId = 0x52674331;  // "RgC1"
constexpr int32_t kOldestVersion = 3;           // that can be brought up to date
constexpr int32_t kVersionWithSummaries = 4;
constexpr int32_t kVersionWithActivations = 5;
constexpr int32_t kVersionWithLights = 6;
constexpr int32_t kVersionWithJobs = 7;

// Positions and counts are rows of their own, so that reading them scans nothing.
//
// batch.id is stream.id * 2^32 + first_seq: the rows of a stream lie together and in order in one
// tree, and a batch costs one insertion. What a stream has above its durable_seq is found from it.
constexpr char kTables[] = R"sql(
CREATE TABLE identity(
  server_id TEXT NOT NULL
);
CREATE TABLE counter(
  name TEXT PRIMARY KEY,
  value INTEGER NOT NULL
) WITHOUT ROWID;
CREATE TABLE session(
  number INTEGER PRIMARY KEY,
  id TEXT NOT NULL UNIQUE,
  rig TEXT NOT NULL,
  state INTEGER NOT NULL,
  body BLOB NOT NULL,
  checksum INTEGER NOT NULL
);
CREATE INDEX session_of_rig ON session(rig, number);
CREATE TABLE deleted_session(
  id TEXT PRIMARY KEY,
  number INTEGER NOT NULL
) WITHOUT ROWID;
CREATE TABLE session_camera(
  id INTEGER PRIMARY KEY,
  session_number INTEGER NOT NULL REFERENCES session(number) ON DELETE CASCADE,
  camera TEXT NOT NULL,
  observation_count INTEGER NOT NULL DEFAULT 0,
  wand_count INTEGER NOT NULL DEFAULT 0,
  late_count INTEGER NOT NULL DEFAULT 0,
  UNIQUE(session_number, camera)
);
CREATE TABLE clock_epoch_count(
  camera_id INTEGER NOT NULL REFERENCES session_camera(id) ON DELETE CASCADE,
  clock_epoch INTEGER NOT NULL,
  observation_count INTEGER NOT NULL,
  PRIMARY KEY(camera_id, clock_epoch)
) WITHOUT ROWID;
CREATE TABLE refusal_count(
  camera_id INTEGER NOT NULL REFERENCES session_camera(id) ON DELETE CASCADE,
  reason TEXT NOT NULL,
  count INTEGER NOT NULL,
  example_stream_epoch INTEGER NOT NULL,
  example_seq INTEGER NOT NULL,
  example TEXT NOT NULL,
  PRIMARY KEY(camera_id, reason)
) WITHOUT ROWID;
CREATE TABLE stream(
  id INTEGER PRIMARY KEY AUTOINCREMENT,
  camera_id INTEGER NOT NULL REFERENCES session_camera(id) ON DELETE CASCADE,
  stream_epoch INTEGER NOT NULL,
  durable_seq INTEGER NOT NULL,
  last_seq INTEGER,
  report_observation_count INTEGER NOT NULL,
  report_refused_count INTEGER NOT NULL,
  UNIQUE(camera_id, stream_epoch)
);
CREATE TABLE report_refusal(
  stream_id INTEGER NOT NULL REFERENCES stream(id) ON DELETE CASCADE,
  reason TEXT NOT NULL,
  count INTEGER NOT NULL,
  example TEXT NOT NULL,
  PRIMARY KEY(stream_id, reason)
) WITHOUT ROWID;
CREATE TABLE report_count(
  stream_id INTEGER NOT NULL REFERENCES stream(id) ON DELETE CASCADE,
  name TEXT NOT NULL,
  count INTEGER NOT NULL,
  PRIMARY KEY(stream_id, name)
) WITHOUT ROWID;
CREATE TABLE batch(
  id INTEGER PRIMARY KEY,
  row_count INTEGER NOT NULL,
  late INTEGER NOT NULL,
  body BLOB NOT NULL
);
CREATE TABLE dropped(
  stream_id INTEGER NOT NULL REFERENCES stream(id) ON DELETE CASCADE,
  first_seq INTEGER NOT NULL,
  seq_count INTEGER NOT NULL,
  reason TEXT NOT NULL,
  PRIMARY KEY(stream_id, first_seq)
) WITHOUT ROWID;
CREATE TABLE clock_sample(
  stream_id INTEGER NOT NULL REFERENCES stream(id) ON DELETE CASCADE,
  clock_epoch INTEGER NOT NULL,
  host_monotonic_ns INTEGER NOT NULL,
  device_ns INTEGER NOT NULL,
  host_utc_ns INTEGER NOT NULL,
  uncertainty_ns INTEGER NOT NULL,
  late INTEGER NOT NULL,
  plausible INTEGER NOT NULL,
  PRIMARY KEY(stream_id, clock_epoch, host_monotonic_ns, device_ns, host_utc_ns, uncertainty_ns)
) WITHOUT ROWID;
CREATE TABLE host_alignment(
  stream_id INTEGER NOT NULL REFERENCES stream(id) ON DELETE CASCADE,
  clock_epoch INTEGER NOT NULL,
  host_monotonic_ns INTEGER NOT NULL,
  server_minus_host_ns INTEGER NOT NULL,
  uncertainty_ns INTEGER NOT NULL,
  late INTEGER NOT NULL,
  plausible INTEGER NOT NULL,
  PRIMARY KEY(stream_id, clock_epoch, host_monotonic_ns, server_minus_host_ns, uncertainty_ns)
) WITHOUT ROWID;
CREATE TABLE calibration(
  number INTEGER PRIMARY KEY,
  id TEXT NOT NULL UNIQUE,
  rig TEXT NOT NULL,
  version INTEGER NOT NULL,
  state INTEGER NOT NULL,
  body BLOB NOT NULL,
  checksum INTEGER NOT NULL,
  UNIQUE(rig, version)
);
CREATE INDEX calibration_of_rig ON calibration(rig, number);
CREATE TABLE calibration_session(
  session_id TEXT NOT NULL,
  calibration_number INTEGER NOT NULL REFERENCES calibration(number) ON DELETE CASCADE,
  PRIMARY KEY(session_id, calibration_number)
) WITHOUT ROWID;
CREATE INDEX session_of_calibration ON calibration_session(calibration_number);
)sql";

// What version 4 has added: what lists show of a record, and which batches were found damaged.
constexpr char kTablesOfVersion4[] = R"sql(
CREATE TABLE session_summary(
  record_number INTEGER PRIMARY KEY REFERENCES session(number) ON DELETE CASCADE,
  body BLOB NOT NULL,
  checksum INTEGER NOT NULL
);
CREATE TABLE calibration_summary(
  record_number INTEGER PRIMARY KEY REFERENCES calibration(number) ON DELETE CASCADE,
  body BLOB NOT NULL,
  checksum INTEGER NOT NULL
);
CREATE TABLE damaged_batch(
  batch_id INTEGER PRIMARY KEY,
  camera_id INTEGER NOT NULL REFERENCES session_camera(id) ON DELETE CASCADE,
  row_count INTEGER NOT NULL,
  example TEXT NOT NULL
);
CREATE INDEX damaged_batch_of_camera ON damaged_batch(camera_id);
)sql";

// What version 6 has added: clock samples of lights (ClockSample::light).
constexpr char kTablesOfVersion6[] = R"sql(
CREATE TABLE light_sample(
  stream_id INTEGER NOT NULL REFERENCES stream(id) ON DELETE CASCADE,
  clock_epoch INTEGER NOT NULL,
  device_ns INTEGER NOT NULL,
  light INTEGER NOT NULL,
  light_ns INTEGER NOT NULL,
  uncertainty_ns INTEGER NOT NULL,
  late INTEGER NOT NULL,
  plausible INTEGER NOT NULL,
  PRIMARY KEY(stream_id, clock_epoch, device_ns, light, light_ns, uncertainty_ns)
) WITHOUT ROWID;
)sql";

// What version 5 has added: which calibration of a rig is active, and which ones were.
constexpr char kActivationTable[] = R"sql(
CREATE TABLE activation(
  rig TEXT NOT NULL,
  number INTEGER NOT NULL,
  calibration_id TEXT NOT NULL,
  body BLOB NOT NULL,
  checksum INTEGER NOT NULL,
  PRIMARY KEY(rig, number)
) WITHOUT ROWID;
)sql";

// What version 7 has added: the queue of calibrations, and the processes that take from it. Times
// are of the database's clock, milliseconds since 1970. See server/store/calibration_job.h.
constexpr char kTablesOfVersion7[] = R"sql(
CREATE TABLE calibration_job(
  calibration_number INTEGER PRIMARY KEY REFERENCES calibration(number) ON DELETE CASCADE,
  state INTEGER NOT NULL,
  software_version TEXT NOT NULL,
  attempts INTEGER NOT NULL DEFAULT 0,
  fence INTEGER NOT NULL DEFAULT 0,
  cancel INTEGER NOT NULL DEFAULT 0,
  holder_host TEXT NOT NULL DEFAULT '',
  holder_pid INTEGER NOT NULL DEFAULT 0,
  holder_version TEXT NOT NULL DEFAULT '',
  holder_is_server INTEGER NOT NULL DEFAULT 0,
  lease_end_ms INTEGER NOT NULL DEFAULT 0,
  stage INTEGER NOT NULL DEFAULT 0,
  fraction_ppm INTEGER NOT NULL DEFAULT 0,
  not_responding INTEGER NOT NULL DEFAULT 0
);
CREATE INDEX unfinished_job ON calibration_job(calibration_number) WHERE state<=2;
CREATE TABLE calibration_worker(
  host TEXT NOT NULL,
  pid INTEGER NOT NULL,
  software_version TEXT NOT NULL,
  start_ms INTEGER NOT NULL,
  heartbeat_ms INTEGER NOT NULL,
  PRIMARY KEY(host, pid)
) WITHOUT ROWID;
)sql";

// A calibration of an earlier version that has not ended.
constexpr char kQueueUnfinished[] = R"sql(
INSERT INTO calibration_job(calibration_number, state, software_version)
  SELECT number, 1, '' FROM calibration WHERE state<=2;
)sql";

std::string RandomId() {
  std::random_device device;
  return absl::StrFormat("%08x%08x%08x%08x", device(), device(), device(), device());
}

int32_t ReadPragma(SQLite::Database& database, const char* pragma) {
  return database.execAndGet(absl::StrCat("PRAGMA ", pragma)).getInt();
}

// Those of a database of this version.
void CreateTablesOf(SQLite::Database& database, int32_t version) {
  database.exec(kTables);
  if (version >= kVersionWithSummaries) database.exec(kTablesOfVersion4);
  if (version >= kVersionWithActivations) database.exec(kActivationTable);
  if (version >= kVersionWithLights) database.exec(kTablesOfVersion6);
  if (version >= kVersionWithJobs) database.exec(kTablesOfVersion7);
}

void CreateTables(SQLite::Database& database) {
  CreateTablesOf(database, kSchemaVersion);
  SQLite::Statement insert(database, "INSERT INTO identity(server_id) VALUES(?)");
  insert.bind(1, RandomId());
  insert.exec();
  database.exec(absl::StrCat("PRAGMA application_id=", kApplicationId));
  database.exec(absl::StrCat("PRAGMA user_version=", kSchemaVersion));
}

// What the schema of a database holds, by name: kind, and the statement that made it.
std::map<std::string, std::string> SchemaOf(SQLite::Database& database) {
  std::map<std::string, std::string> schema;
  SQLite::Statement row(database, "SELECT type, name, tbl_name, sql FROM sqlite_schema");
  while (row.executeStep()) {
    std::string sql = row.getColumn(3).getString();
    absl::RemoveExtraAsciiWhitespace(&sql);
    schema[row.getColumn(1).getString()] =
        absl::StrCat(row.getColumn(0).getString(), " of ", row.getColumn(2).getString(), ": ", sql);
  }
  return schema;
}

// Statistics that somebody has made with ANALYZE; SQLite makes these tables itself.
bool IsStatistics(const std::string& name) {
  return name == "sqlite_stat1" || name == "sqlite_stat4";
}

// Triggers, views and the like would run with what the server does, and a table of another form may
// hold expressions that do.
absl::Status CheckNothingElse(SQLite::Database& database, const std::string& file,
                              int32_t version) {
  SQLite::Database own(":memory:", SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
  CreateTablesOf(own, version);
  own.exec(kBackupTable);
  const std::map<std::string, std::string> expected = SchemaOf(own);
  for (const auto& [name, made] : SchemaOf(database)) {
    if (IsStatistics(name)) continue;
    const auto found = expected.find(name);
    if (found != expected.end() && found->second == made) continue;
    return absl::FailedPreconditionError(
        absl::StrCat(file, " is not used: it holds the ", made.substr(0, made.find(' ')), " '",
                     absl::CHexEscape(name.substr(0, 64)),
                     "', which rigcal has not made, and which could run when the data is used. "
                     "Take another backup; or, if you know where it comes from, remove it with "
                     "sqlite3 and try again"));
  }
  return absl::OkStatus();
}

// From any older one that is read.
void Migrate(SQLite::Database& database, int32_t version) {
  if (version < kVersionWithSummaries) {
    database.exec(kTablesOfVersion4);
    SqliteDatabase tables(database);
    SummarizeSessions(tables);
    SummarizeCalibrations(tables);
  }
  if (version < kVersionWithActivations) database.exec(kActivationTable);
  if (version < kVersionWithLights) database.exec(kTablesOfVersion6);
  if (version < kVersionWithJobs) {
    database.exec(kTablesOfVersion7);
    database.exec(kQueueUnfinished);
  }
  database.exec(absl::StrCat("PRAGMA user_version=", kSchemaVersion));
}

}  // namespace

absl::Status CheckSchema(SQLite::Database& database, std::string_view file) {
  const std::string name(file);
  const int32_t version = ReadPragma(database, "user_version");
  if (ReadPragma(database, "application_id") != kApplicationId) {
    return absl::FailedPreconditionError(absl::StrCat(
        name, " is a database of another program; give another --data-dir or move it away"));
  }
  if (version < 1) {
    return absl::DataLossError(absl::StrCat(name, " has no valid schema version (", version,
                                            "); restore a backup or give another --data-dir"));
  }
  if (version == static_cast<int32_t>(kSchemaVersion)) {
    return CheckNothingElse(database, name, version);
  }
  const bool is_older = version < static_cast<int32_t>(kSchemaVersion);
  return absl::FailedPreconditionError(absl::StrCat(
      name, " has schema version ", version,
      is_older && version < kOldestVersion ? ", from before API v1 was settled" : "",
      ", and this server reads version ", kSchemaVersion, "; ",
      !is_older ? "start a newer rigcal-server, or give another --data-dir"
      : version >= kOldestVersion
          ? "start this server on it once: it brings the database up to date"
          : "export what you need with the rigcal-server that wrote it, and give this one another "
            "--data-dir"));
}

absl::Status PrepareSchema(SQLite::Database& database, std::string_view file) {
  const int32_t application_id = ReadPragma(database, "application_id");
  const int32_t version = ReadPragma(database, "user_version");
  const int object_count = database.execAndGet("SELECT count(*) FROM sqlite_schema").getInt();
  if (object_count == 0 && application_id == 0 && version == 0) {
    CreateTables(database);
  } else if (application_id == kApplicationId && version >= kOldestVersion &&
             version < static_cast<int32_t>(kSchemaVersion)) {
    RIGCAL_RETURN_IF_ERROR(CheckNothingElse(database, std::string(file), version));
    Migrate(database, version);
  }
  return CheckSchema(database, file);
}

absl::StatusOr<std::string> ReadServerId(SQLite::Database& database) {
  SQLite::Statement query(database, "SELECT server_id FROM identity");
  if (!query.executeStep()) {
    return absl::DataLossError("the database has lost its identity; restore a backup");
  }
  return query.getColumn(0).getString();
}

}  // namespace rigcal::server

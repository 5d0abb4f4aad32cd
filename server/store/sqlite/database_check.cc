// SPDX-License-Identifier: Apache-2.0
#include "server/store/sqlite/database_check.h"

#include <algorithm>
#include <map>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/wire/calibration_wire.h"
#include "common/wire/session_wire.h"
#include "server/store/sqlite/batch_blob.h"
#include "server/store/sqlite/record_table.h"
#include "server/store/sqlite/sqlite_connection.h"
#include "server/store/sqlite/sqlite_schema.h"
#include "server/store/stream_ledger.h"

namespace rigcal::server {
namespace {

constexpr size_t kMaxListedFaults = 1000;
// Of the structure, for SQLite's own check.
constexpr int kMaxStructureFaults = 100;
constexpr uint64_t kProgressBatches = 512;
constexpr int kBusyTimeoutOfCheckMs = 10'000;

// What the batches of a camera hold.
struct StoredCounts {
  uint64_t observations = 0;
  uint64_t wands = 0;
  uint64_t late = 0;
  uint64_t damaged_rows = 0;
};

struct CheckedStream {
  int64_t id = 0;
  uint32_t durable_seq = 0;
  StreamKey key;
};

// Goes through one database, table by table. A damaged page ends the table it is in.
class DatabaseCheck {
 public:
  DatabaseCheck(SQLite::Database& database, const CareProgress& progress)
      : database_(database), progress_(progress) {}

  DatabaseReport Run() {
    Guarded("the structure", [this] { CheckStructure(); });
    Guarded("the sessions",
            [this] { report_.session_count = CheckRecords("session", wire::ParseSession); });
    Guarded("the calibrations", [this] {
      report_.calibration_count = CheckRecords("calibration", wire::ParseCalibration);
    });
    Guarded("the batches", [this] {
      batch_total_ = static_cast<uint64_t>(
          std::max<int64_t>(1, database_.execAndGet("SELECT count(*) FROM batch").getInt64()));
    });
    Guarded("the cameras", [this] { CheckCameras(); });
    progress_(1);
    return std::move(report_);
  }

 private:
  template <typename Work>
  void Guarded(const std::string& what, const Work& work) {
    try {
      work();
    } catch (const SQLite::Exception& error) {
      report_.AddFault(std::string(StatusFromSqlite(error, "reading " + what).message()));
    }
  }

  void CheckStructure() {
    SQLite::Statement integrity(database_,
                                absl::StrCat("PRAGMA integrity_check(", kMaxStructureFaults, ")"));
    while (integrity.executeStep()) {
      const std::string line = integrity.getColumn(0).getString();
      if (line != "ok") report_.AddFault("the structure of the database is damaged: " + line);
    }
    SQLite::Statement keys(database_, "PRAGMA foreign_key_check");
    while (keys.executeStep()) {
      report_.AddFault(
          absl::StrCat("a row of table ", keys.getColumn(0).getString(), " belongs to nothing"));
    }
  }

  template <typename Record>
  uint64_t CheckRecords(const char* table, absl::StatusOr<Record> (*parse)(std::string_view body)) {
    uint64_t count = 0;
    SQLite::Statement row(database_, absl::StrCat("SELECT id, body, checksum FROM ", table));
    for (; row.executeStep(); ++count) {
      const absl::Status status = ParseRecord(row, table, parse).status();
      if (!status.ok()) report_.AddFault(std::string(status.message()));
    }
    SQLite::Statement summary(
        database_, absl::StrCat("SELECT r.id, s.body, s.checksum FROM ", table, "_summary s JOIN ",
                                table, " r ON s.record_number=r.number"));
    while (summary.executeStep()) {
      if (Checksum(ColumnBytes(summary, 1)) == ColumnUint32(summary, 2)) continue;
      report_.AddFault(absl::StrCat("the summary of ", table, " ", summary.getColumn(0).getString(),
                                    " is damaged: its checksum is wrong"));
    }
    return count;
  }

  void CheckCameras() {
    SQLite::Statement row(database_,
                          "SELECT c.id, s.id, c.camera, c.observation_count, c.wand_count, "
                          "c.late_count FROM session_camera c "
                          "JOIN session s ON s.number=c.session_number ORDER BY c.id");
    while (row.executeStep()) {
      const std::string name = absl::StrCat("session ", row.getColumn(1).getString(), ", camera ",
                                            row.getColumn(2).getString());
      StoredCounts stored;
      Guarded(name, [&] {
        for (const CheckedStream& stream :
             Streams(row.getColumn(0).getInt64(), row.getColumn(1).getString(),
                     row.getColumn(2).getString())) {
          Guarded(name, [&] { CheckStream(stream, &stored); });
        }
      });
      report_.observation_count += stored.observations;
      report_.damaged_row_count += stored.damaged_rows;
      if (emptied_) continue;
      CompareCount(name, "observations", ColumnUint64(row, 3), stored.observations, stored);
      CompareCount(name, "wands", ColumnUint64(row, 4), stored.wands, stored);
      CompareCount(name, "late observations", ColumnUint64(row, 5), stored.late, stored);
    }
  }

  // Where batches are damaged, some of what was counted cannot be read.
  void CompareCount(const std::string& name, const char* what, uint64_t counted, uint64_t found,
                    const StoredCounts& stored) {
    if (found <= counted && counted <= found + stored.damaged_rows) return;
    report_.AddFault(
        absl::StrCat(name, ": ", found, " ", what, " are stored, and ", counted, " are counted"));
  }

  std::vector<CheckedStream> Streams(int64_t camera_id, const std::string& session,
                                     const std::string& camera) {
    // The observations were deleted: what is counted is history.
    emptied_ = false;
    const auto parsed = FindRecord(database_, "session", session, wire::ParseSession);
    if (parsed.ok()) emptied_ = parsed->observations_delete_utc_ns != 0;
    std::vector<CheckedStream> streams;
    SQLite::Statement row = Query(
        database_, "SELECT id, stream_epoch, durable_seq FROM stream WHERE camera_id=?", camera_id);
    while (row.executeStep()) {
      streams.push_back(
          {.id = row.getColumn(0).getInt64(),
           .durable_seq = ColumnUint32(row, 2),
           .key = {.session_id = session, .camera = camera, .stream_epoch = ColumnUint32(row, 1)}});
    }
    return streams;
  }

  void CheckStream(const CheckedStream& stream, StoredCounts* stored) {
    StreamLedger ledger;
    SQLite::Statement batch = Query(database_,
                                    "SELECT id & 0xffffffff, row_count, late, body FROM batch "
                                    "WHERE id > (?1<<32) AND id <= (?1<<32) + 0xffffffff "
                                    "ORDER BY id",
                                    stream.id);
    uint32_t end_seq = 1;
    while (batch.executeStep()) {
      const SeqRange rows = CheckBatch(batch, stream.key, stored);
      if (rows.first < end_seq) {
        report_.AddFault(
            absl::StrCat(NameOf(stream.key), ": seq ", rows.first, " is stored in two batches"));
      }
      end_seq = std::max(end_seq, rows.end);
      ledger.Add(rows);
    }
    SQLite::Statement dropped =
        Query(database_, "SELECT first_seq, seq_count FROM dropped WHERE stream_id=?", stream.id);
    while (dropped.executeStep()) {
      const uint32_t first = ColumnUint32(dropped, 0);
      ledger.Add({first, first + ColumnUint32(dropped, 1)});
    }
    if (ledger.durable_seq() != stream.durable_seq && !emptied_) {
      report_.AddFault(absl::StrCat(NameOf(stream.key), ": stored up to seq ", ledger.durable_seq(),
                                    ", and noted up to ", stream.durable_seq));
    }
  }

  SeqRange CheckBatch(SQLite::Statement& row, const StreamKey& stream, StoredCounts* stored) {
    const uint32_t first_seq = ColumnUint32(row, 0);
    const uint32_t row_count = ColumnUint32(row, 1);
    if (++report_.batch_count % kProgressBatches == 0) {
      progress_(static_cast<double>(report_.batch_count) / static_cast<double>(batch_total_));
    }
    const absl::StatusOr<StoredBatch> batch = DecodeBatch(ColumnBytes(row, 3), stream, first_seq);
    if (!batch.ok()) {
      report_.AddFault(std::string(batch.status().message()));
      stored->damaged_rows += row_count;
      return {first_seq, first_seq + row_count};
    }
    const bool late = row.getColumn(2).getInt() != 0;
    for (size_t i = 0; i < batch->batch.rows(); ++i) {
      if (!batch->refused_rows.empty() && batch->refused_rows[i]) continue;
      ++stored->observations;
      if (batch->batch.visible_mask[i] != 0) ++stored->wands;
      if (late) ++stored->late;
    }
    if (batch->batch.rows() != row_count) {
      report_.AddFault(absl::StrCat(NameOf(stream), ", from seq ", first_seq, ": ",
                                    batch->batch.rows(), " rows are stored, and ", row_count,
                                    " are noted"));
    }
    return {first_seq, batch->batch.end_seq()};
  }

  static std::string NameOf(const StreamKey& stream) {
    return absl::StrCat("session ", stream.session_id, ", camera ", stream.camera,
                        ", stream epoch ", stream.stream_epoch);
  }

  SQLite::Database& database_;
  const CareProgress& progress_;
  DatabaseReport report_;
  uint64_t batch_total_ = 1;
  bool emptied_ = false;  // the session at hand
};

}  // namespace

void DatabaseReport::AddFault(std::string fault) {
  ++fault_count;
  if (faults.size() < kMaxListedFaults) faults.push_back(std::move(fault));
}

absl::StatusOr<DatabaseReport> CheckDatabase(const std::filesystem::path& file,
                                             const CareProgress& progress) {
  std::error_code error;
  if (!std::filesystem::exists(file, error)) {
    return absl::NotFoundError(absl::StrCat("there is no database ", file.string()));
  }
  try {
    SQLite::Database database(file.string(), SQLite::OPEN_READONLY, kBusyTimeoutOfCheckMs);
    DistrustSchema(database);
    database.exec("PRAGMA mmap_size=0; PRAGMA cell_size_check=ON");
    // One state for all that is read. Ends with the connection: after damage it cannot be ended
    // in an orderly way.
    database.exec("BEGIN");
    RIGCAL_RETURN_IF_ERROR(CheckSchema(database, file.string()));
    return DatabaseCheck(database, progress).Run();
  } catch (const SQLite::Exception& error_of_sqlite) {
    return StatusFromSqlite(error_of_sqlite, absl::StrCat("checking ", file.string()));
  }
}

}  // namespace rigcal::server

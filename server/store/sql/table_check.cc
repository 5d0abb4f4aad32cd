// SPDX-License-Identifier: Apache-2.0
#include "server/store/sql/table_check.h"

#include <algorithm>
#include <exception>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/wire/calibration_wire.h"
#include "common/wire/session_wire.h"
#include "server/store/batch_blob.h"
#include "server/store/sql/record_table.h"
#include "server/store/stream_ledger.h"

namespace rigcal::server {
namespace {

constexpr size_t kMaxListedFaults = 1000;
constexpr uint64_t kProgressBatches = 512;
// Read at once: a batch is a few megabytes at most.
constexpr int kCheckedBatches = 16;

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
class TableCheck {
 public:
  TableCheck(SqlDatabase& database, const CareProgress& progress, DatabaseReport* report)
      : database_(database), progress_(progress), report_(*report) {}

  void Run() {
    Guarded("the sessions",
            [this] { report_.session_count = CheckRecords("session", wire::ParseSession); });
    Guarded("the calibrations", [this] {
      report_.calibration_count = CheckRecords("calibration", wire::ParseCalibration);
    });
    Guarded("the batches", [this] {
      SqlStatement count(database_, "SELECT count(*) FROM batch");
      if (count.Step()) batch_total_ = std::max<uint64_t>(1, count.Uint64(0));
    });
    Guarded("the cameras", [this] { CheckCameras(); });
    progress_(1);
  }

 private:
  template <typename Work>
  void Guarded(const std::string& what, const Work& work) {
    try {
      work();
    } catch (const std::exception& error) {
      report_.AddFault(std::string(database_.StatusOf(error, "reading " + what).message()));
    }
  }

  template <typename Record>
  uint64_t CheckRecords(const char* table, absl::StatusOr<Record> (*parse)(std::string_view body)) {
    uint64_t count = 0;
    SqlStatement row(database_, absl::StrCat("SELECT id, body, checksum FROM ", table));
    for (; row.Step(); ++count) {
      const absl::Status status = ParseRecord(row, table, parse).status();
      if (!status.ok()) report_.AddFault(std::string(status.message()));
    }
    SqlStatement summary(
        database_, absl::StrCat("SELECT r.id, s.body, s.checksum FROM ", table, "_summary s JOIN ",
                                table, " r ON s.record_number=r.number"));
    while (summary.Step()) {
      if (Checksum(summary.Bytes(1)) == summary.Uint32(2)) continue;
      report_.AddFault(absl::StrCat("the summary of ", table, " ", summary.Text(0),
                                    " is damaged: its checksum is wrong"));
    }
    return count;
  }

  void CheckCameras() {
    SqlStatement row(database_,
                     "SELECT c.id, s.id, c.camera, c.observation_count, c.wand_count, "
                     "c.late_count FROM session_camera c "
                     "JOIN session s ON s.number=c.session_number ORDER BY c.id");
    while (row.Step()) {
      const std::string name = absl::StrCat("session ", row.Text(1), ", camera ", row.Text(2));
      StoredCounts stored;
      Guarded(name, [&] {
        for (const CheckedStream& stream : Streams(row.Int64(0), row.Text(1), row.Text(2))) {
          Guarded(name, [&] { CheckStream(stream, &stored); });
        }
      });
      report_.observation_count += stored.observations;
      report_.damaged_row_count += stored.damaged_rows;
      if (emptied_) continue;
      CompareCount(name, "observations", row.Uint64(3), stored.observations, stored);
      CompareCount(name, "wands", row.Uint64(4), stored.wands, stored);
      CompareCount(name, "late observations", row.Uint64(5), stored.late, stored);
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
    SqlStatement row = Query(
        database_, "SELECT id, stream_epoch, durable_seq FROM stream WHERE camera_id=?", camera_id);
    while (row.Step()) {
      streams.push_back(
          {.id = row.Int64(0),
           .durable_seq = row.Uint32(2),
           .key = {.session_id = session, .camera = camera, .stream_epoch = row.Uint32(1)}});
    }
    return streams;
  }

  void CheckStream(const CheckedStream& stream, StoredCounts* stored) {
    StreamLedger ledger;
    uint64_t end_seq = 1;
    uint32_t after = 0;
    for (bool more = true; more;) {
      SqlStatement batch = Query(database_,
                                 "SELECT id & 4294967295, row_count, late, body FROM batch "
                                 "WHERE id > (?1<<32) + ?2 AND id <= (?1<<32) + 4294967295 "
                                 "ORDER BY id LIMIT ?3",
                                 stream.id, after, kCheckedBatches);
      for (more = false; batch.Step(); more = true) {
        after = batch.Uint32(0);
        const SeqRange rows = CheckBatch(batch, stream.key, stored);
        if (rows.first < end_seq) {
          report_.AddFault(
              absl::StrCat(NameOf(stream.key), ": seq ", rows.first, " is stored in two batches"));
        }
        end_seq = std::max<uint64_t>(end_seq, rows.end);
        ledger.Add(rows);
      }
    }
    SqlStatement dropped =
        Query(database_, "SELECT first_seq, seq_count FROM dropped WHERE stream_id=?", stream.id);
    while (dropped.Step()) {
      const uint32_t first = dropped.Uint32(0);
      ledger.Add({first, first + dropped.Uint32(1)});
    }
    if (ledger.durable_seq() != stream.durable_seq && !emptied_) {
      report_.AddFault(absl::StrCat(NameOf(stream.key), ": stored up to seq ", ledger.durable_seq(),
                                    ", and noted up to ", stream.durable_seq));
    }
  }

  SeqRange CheckBatch(SqlStatement& row, const StreamKey& stream, StoredCounts* stored) {
    const uint32_t first_seq = row.Uint32(0);
    const uint32_t row_count = row.Uint32(1);
    if (++report_.batch_count % kProgressBatches == 0) {
      progress_(static_cast<double>(report_.batch_count) / static_cast<double>(batch_total_));
    }
    const absl::StatusOr<StoredBatch> batch = DecodeBatch(row.Bytes(3), stream, first_seq);
    if (!batch.ok()) {
      report_.AddFault(std::string(batch.status().message()));
      stored->damaged_rows += row_count;
      return {first_seq, first_seq + row_count};
    }
    const bool late = row.Int64(2) != 0;
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

  SqlDatabase& database_;
  const CareProgress& progress_;
  DatabaseReport& report_;
  uint64_t batch_total_ = 1;
  bool emptied_ = false;  // the session at hand
};

}  // namespace

void DatabaseReport::AddFault(std::string fault) {
  ++fault_count;
  if (faults.size() < kMaxListedFaults) faults.push_back(std::move(fault));
}

void CheckTables(SqlDatabase& database, const CareProgress& progress, DatabaseReport* report) {
  TableCheck(database, progress, report).Run();
}

}  // namespace rigcal::server

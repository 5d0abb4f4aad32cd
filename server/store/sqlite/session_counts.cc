// SPDX-License-Identifier: Apache-2.0
#include <string>
#include <utility>
#include <vector>

#include "common/status/status_macros.h"
#include "server/store/report_counts.h"
#include "server/store/sqlite/session_table.h"
#include "server/store/sqlite/sqlite_connection.h"

namespace rigcal::server {
namespace {

std::vector<ClockEpochCount> ReadClockEpochs(SQLite::Database& database, int64_t camera_id) {
  SQLite::Statement query = Query(database,
                                  "SELECT clock_epoch, observation_count FROM clock_epoch_count "
                                  "WHERE camera_id=? ORDER BY clock_epoch",
                                  camera_id);
  std::vector<ClockEpochCount> epochs;
  while (query.executeStep()) {
    epochs.push_back(
        {.clock_epoch = ColumnUint32(query, 0), .observation_count = ColumnUint64(query, 1)});
  }
  return epochs;
}

// Rows refused by ingest, and refusals in the reports of all its streams.
std::vector<Refusal> ReadRefusals(SQLite::Database& database, int64_t camera_id,
                                  const std::string& camera) {
  RefusalCounter refusals;
  SQLite::Statement query =
      Query(database,
            "SELECT reason, count, example FROM refusal_count WHERE camera_id=?1 "
            "UNION ALL "
            "SELECT r.reason, r.count, r.example FROM report_refusal r "
            "JOIN stream s ON r.stream_id=s.id WHERE s.camera_id=?1 "
            "UNION ALL "
            "SELECT 'damaged_record', sum(row_count), min(example) FROM damaged_batch "
            "WHERE camera_id=?1 GROUP BY camera_id "
            "ORDER BY 1, 2, 3",
            camera_id);
  while (query.executeStep()) {
    refusals.Add(camera, RefusalReasonFromName(query.getColumn(0).getString()),
                 ColumnUint64(query, 1), query.getColumn(2).getString());
  }
  return refusals.List();
}

void ReadReportCounts(SQLite::Database& database, int64_t camera_id, SessionCameraCounts* camera) {
  SQLite::Statement query =
      Query(database,
            "SELECT r.name, sum(r.count) FROM report_count r "
            "JOIN stream s ON r.stream_id=s.id WHERE s.camera_id=? GROUP BY r.name",
            camera_id);
  while (query.executeStep()) {
    AddNamedCount(query.getColumn(0).getString(), ColumnUint64(query, 1), camera);
  }
}

}  // namespace

std::vector<StreamStatus> ReadStreams(SQLite::Database& database, int64_t camera_id) {
  SQLite::Statement query = Query(database,
                                  "SELECT stream_epoch, durable_seq, last_seq, "
                                  "coalesce((SELECT count FROM report_count WHERE stream_id=s.id "
                                  "AND name='spool.last_seq'), 0), "
                                  "EXISTS (SELECT 1 FROM report_count WHERE stream_id=s.id "
                                  "AND name='spool.end_is_unknown') FROM stream s "
                                  "WHERE camera_id=? ORDER BY stream_epoch",
                                  camera_id);
  std::vector<StreamStatus> streams;
  while (query.executeStep()) {
    StreamStatus status;
    status.stream_epoch = ColumnUint32(query, 0);
    status.durable_seq = ColumnUint32(query, 1);
    if (!query.getColumn(2).isNull()) status.last_seq = ColumnUint32(query, 2);
    status.reported_seq = ColumnUint32(query, 3);
    status.end_is_unknown = ColumnUint32(query, 4) != 0;
    streams.push_back(status);
  }
  return streams;
}

absl::StatusOr<std::vector<SessionCameraCounts>> ReadSessionCounts(SQLite::Database& database,
                                                                   std::string_view id) {
  RIGCAL_ASSIGN_OR_RETURN(const int64_t number, SessionNumber(database, id));
  SQLite::Statement query = Query(database,
                                  "SELECT id, camera, observation_count, wand_count, late_count "
                                  "FROM session_camera WHERE session_number=? ORDER BY camera",
                                  number);
  std::vector<SessionCameraCounts> counts;
  while (query.executeStep()) {
    const int64_t camera_id = query.getColumn(0).getInt64();
    SessionCameraCounts camera;
    camera.camera = query.getColumn(1).getString();
    camera.observation_count = ColumnUint64(query, 2);
    camera.wand_count = ColumnUint64(query, 3);
    camera.late_count = ColumnUint64(query, 4);
    camera.clock_epochs = ReadClockEpochs(database, camera_id);
    camera.streams = ReadStreams(database, camera_id);
    camera.refused = ReadRefusals(database, camera_id, camera.camera);
    ReadReportCounts(database, camera_id, &camera);
    counts.push_back(std::move(camera));
  }
  return counts;
}

}  // namespace rigcal::server

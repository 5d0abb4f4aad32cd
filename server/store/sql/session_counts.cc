// SPDX-License-Identifier: Apache-2.0
#include <string>
#include <utility>
#include <vector>

#include "common/status/status_macros.h"
#include "server/store/report_counts.h"
#include "server/store/sql/session_table.h"
#include "server/store/sql/sql_database.h"

namespace rigcal::server {
namespace {

std::vector<ClockEpochCount> ReadClockEpochs(SqlDatabase& database, int64_t camera_id) {
  SqlStatement query = Query(database,
                             "SELECT clock_epoch, observation_count FROM clock_epoch_count "
                             "WHERE camera_id=? ORDER BY clock_epoch",
                             camera_id);
  std::vector<ClockEpochCount> epochs;
  while (query.Step()) {
    epochs.push_back({.clock_epoch = query.Uint32(0), .observation_count = query.Uint64(1)});
  }
  return epochs;
}

// Rows refused by ingest, and refusals in the reports of all its streams.
std::vector<Refusal> ReadRefusals(SqlDatabase& database, int64_t camera_id,
                                  const std::string& camera) {
  RefusalCounter refusals;
  SqlStatement query = Query(
      database,
      "SELECT reason, count, example FROM refusal_count WHERE camera_id=?1 "
      "UNION ALL "
      "SELECT r.reason, r.count, r.example FROM report_refusal r "
      "JOIN stream s ON r.stream_id=s.id WHERE s.camera_id=?1 "
      "UNION ALL "
      "SELECT 'damaged_record', CAST(sum(row_count) AS BIGINT), min(example) FROM damaged_batch "
      "WHERE camera_id=?1 GROUP BY camera_id "
      "ORDER BY 1, 2, 3",
      camera_id);
  while (query.Step()) {
    refusals.Add(camera, RefusalReasonFromName(query.Text(0)), query.Uint64(1), query.Text(2));
  }
  return refusals.List();
}

void ReadReportCounts(SqlDatabase& database, int64_t camera_id, SessionCameraCounts* camera) {
  SqlStatement query =
      Query(database,
            "SELECT r.name, CAST(sum(r.count) AS BIGINT) FROM report_count r "
            "JOIN stream s ON r.stream_id=s.id WHERE s.camera_id=? GROUP BY r.name",
            camera_id);
  while (query.Step()) {
    AddNamedCount(query.Text(0), query.Uint64(1), camera);
  }
}

}  // namespace

std::vector<StreamStatus> ReadStreams(SqlDatabase& database, int64_t camera_id) {
  SqlStatement query = Query(database,
                             "SELECT stream_epoch, durable_seq, last_seq, "
                             "coalesce((SELECT count FROM report_count WHERE stream_id=s.id "
                             "AND name='spool.last_seq'), 0), "
                             "EXISTS (SELECT 1 FROM report_count WHERE stream_id=s.id "
                             "AND name='spool.end_is_unknown') FROM stream s "
                             "WHERE camera_id=? ORDER BY stream_epoch",
                             camera_id);
  std::vector<StreamStatus> streams;
  while (query.Step()) {
    StreamStatus status;
    status.stream_epoch = query.Uint32(0);
    status.durable_seq = query.Uint32(1);
    if (!query.IsNull(2)) status.last_seq = query.Uint32(2);
    status.reported_seq = query.Uint32(3);
    status.end_is_unknown = query.Uint32(4) != 0;
    streams.push_back(status);
  }
  return streams;
}

absl::StatusOr<std::vector<SessionCameraCounts>> ReadSessionCounts(SqlDatabase& database,
                                                                   std::string_view id) {
  RIGCAL_ASSIGN_OR_RETURN(const int64_t number, SessionNumber(database, id));
  SqlStatement query = Query(database,
                             "SELECT id, camera, observation_count, wand_count, late_count "
                             "FROM session_camera WHERE session_number=? ORDER BY camera",
                             number);
  std::vector<SessionCameraCounts> counts;
  while (query.Step()) {
    const int64_t camera_id = query.Int64(0);
    SessionCameraCounts camera;
    camera.camera = query.Text(1);
    camera.observation_count = query.Uint64(2);
    camera.wand_count = query.Uint64(3);
    camera.late_count = query.Uint64(4);
    camera.clock_epochs = ReadClockEpochs(database, camera_id);
    camera.streams = ReadStreams(database, camera_id);
    camera.refused = ReadRefusals(database, camera_id, camera.camera);
    ReadReportCounts(database, camera_id, &camera);
    counts.push_back(std::move(camera));
  }
  return counts;
}

}  // namespace rigcal::server

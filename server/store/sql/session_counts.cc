// SPDX-License-Identifier: Apache-2.0
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/store/report_counts.h"
#include "server/store/sql/session_table.h"
#include "server/store/sql/sql_database.h"

namespace rigcal::server {
namespace {

// A session's cameras with their counts, by the id of their rows.
using CamerasById = std::map<int64_t, SessionCameraCounts*>;

// Each kind of count is read at once for all cameras: a large rig has hundreds, and its agents ask
// one after the other when they connect.
constexpr char kOfSession[] = "IN (SELECT id FROM session_camera WHERE session_number=?1)";

void ReadClockEpochs(SqlDatabase& database, int64_t session_number, const CamerasById& cameras) {
  SqlStatement query =
      Query(database,
            absl::StrCat("SELECT camera_id, clock_epoch, observation_count FROM clock_epoch_count "
                         "WHERE camera_id ",
                         kOfSession, " ORDER BY camera_id, clock_epoch"),
            session_number);
  while (query.Step()) {
    cameras.at(query.Int64(0))
        ->clock_epochs.push_back(
            {.clock_epoch = query.Uint32(1), .observation_count = query.Uint64(2)});
  }
}

// Rows refused by ingest, and refusals in the reports of all streams.
void ReadRefusals(SqlDatabase& database, int64_t session_number, const CamerasById& cameras) {
  std::map<int64_t, RefusalCounter> refusals;
  SqlStatement query =
      Query(database,
            absl::StrCat(
                "SELECT camera_id, reason, count, example FROM refusal_count WHERE camera_id ",
                kOfSession,
                " UNION ALL "
                "SELECT s.camera_id, r.reason, r.count, r.example FROM report_refusal r "
                "JOIN stream s ON r.stream_id=s.id WHERE s.camera_id ",
                kOfSession,
                " UNION ALL "
                "SELECT camera_id, 'damaged_record', CAST(sum(row_count) AS BIGINT), min(example) "
                "FROM damaged_batch WHERE camera_id ",
                kOfSession, " GROUP BY camera_id ORDER BY 1, 2, 3, 4"),
            session_number);
  while (query.Step()) {
    refusals[query.Int64(0)].Add(cameras.at(query.Int64(0))->camera,
                                 RefusalReasonFromName(query.Text(1)), query.Uint64(2),
                                 query.Text(3));
  }
  for (const auto& [id, counter] : refusals) cameras.at(id)->refused = counter.List();
}

void ReadReportCounts(SqlDatabase& database, int64_t session_number, const CamerasById& cameras) {
  SqlStatement query = Query(
      database,
      absl::StrCat("SELECT s.camera_id, r.name, CAST(sum(r.count) AS BIGINT) FROM report_count r "
                   "JOIN stream s ON r.stream_id=s.id WHERE s.camera_id ",
                   kOfSession, " GROUP BY s.camera_id, r.name"),
      session_number);
  while (query.Step()) {
    AddNamedCount(query.Text(1), query.Uint64(2), cameras.at(query.Int64(0)));
  }
}

// `which`: a condition on camera_id, with the parameter `value`. By camera id and stream epoch.
std::vector<std::pair<int64_t, StreamStatus>> ReadStreamsOf(SqlDatabase& database,
                                                            const char* which, int64_t value) {
  SqlStatement query =
      Query(database,
            absl::StrCat("SELECT camera_id, stream_epoch, durable_seq, last_seq, "
                         "coalesce((SELECT count FROM report_count WHERE stream_id=s.id "
                         "AND name='spool.last_seq'), 0), "
                         "EXISTS (SELECT 1 FROM report_count WHERE stream_id=s.id "
                         "AND name='spool.end_is_unknown') FROM stream s WHERE camera_id ",
                         which, " ORDER BY camera_id, stream_epoch"),
            value);
  std::vector<std::pair<int64_t, StreamStatus>> streams;
  while (query.Step()) {
    StreamStatus status;
    status.stream_epoch = query.Uint32(1);
    status.durable_seq = query.Uint32(2);
    if (!query.IsNull(3)) status.last_seq = query.Uint32(3);
    status.reported_seq = query.Uint32(4);
    status.end_is_unknown = query.Uint32(5) != 0;
    streams.emplace_back(query.Int64(0), status);
  }
  return streams;
}

}  // namespace

std::vector<StreamStatus> ReadStreams(SqlDatabase& database, int64_t camera_id) {
  std::vector<StreamStatus> streams;
  for (auto& [id, status] : ReadStreamsOf(database, "=?1", camera_id)) streams.push_back(status);
  return streams;
}

absl::StatusOr<std::vector<SessionCameraCounts>> ReadSessionCounts(SqlDatabase& database,
                                                                   std::string_view id) {
  RIGCAL_ASSIGN_OR_RETURN(const int64_t number, SessionNumber(database, id));
  std::vector<SessionCameraCounts> counts;
  std::vector<int64_t> camera_ids;
  {
    SqlStatement query = Query(database,
                               "SELECT id, camera, observation_count, wand_count, late_count "
                               "FROM session_camera WHERE session_number=? ORDER BY camera",
                               number);
    while (query.Step()) {
      camera_ids.push_back(query.Int64(0));
      SessionCameraCounts& camera = counts.emplace_back();
      camera.camera = query.Text(1);
      camera.observation_count = query.Uint64(2);
      camera.wand_count = query.Uint64(3);
      camera.late_count = query.Uint64(4);
    }
  }
  CamerasById cameras;
  for (size_t i = 0; i < counts.size(); ++i) cameras[camera_ids[i]] = &counts[i];
  ReadClockEpochs(database, number, cameras);
  for (auto& [camera_id, status] : ReadStreamsOf(database, kOfSession, number)) {
    cameras.at(camera_id)->streams.push_back(status);
  }
  ReadRefusals(database, number, cameras);
  ReadReportCounts(database, number, cameras);
  return counts;
}

}  // namespace rigcal::server

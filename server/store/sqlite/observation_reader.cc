// SPDX-License-Identifier: Apache-2.0
#include "server/store/sqlite/observation_reader.h"

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/store/sqlite/batch_blob.h"
#include "server/store/sqlite/session_table.h"

namespace rigcal::server {
namespace {

constexpr char kWhat[] = "reading observations";
// Read at once, while other readers wait: a few milliseconds.
constexpr int kChunkBatches = 256;
constexpr size_t kChunkBytes = 1u << 20;

struct StoredStream {
  int64_t id = 0;
  StreamKey key;
};

// Clock samples and alignments of a stream that have not been handed out, by (clock epoch, late).
struct ClockReadings {
  std::vector<ClockSample> samples;
  std::vector<HostAlignment> alignments;
};
using ReadingsByEpoch = std::map<std::pair<uint32_t, bool>, ClockReadings>;

absl::StatusOr<int64_t> CameraId(SQLite::Database& database, std::string_view session_id,
                                 std::string_view camera) {
  RIGCAL_ASSIGN_OR_RETURN(const int64_t number, SessionNumber(database, session_id));
  SQLite::Statement query =
      Query(database, "SELECT id FROM session_camera WHERE session_number=? AND camera=?", number,
            camera);
  if (query.executeStep()) return query.getColumn(0).getInt64();
  return absl::NotFoundError(
      absl::StrCat("session ", std::string(session_id), " has no camera ", std::string(camera)));
}

absl::Status ListStreams(SQLite::Database& database, std::string_view session_id,
                         std::string_view camera, std::vector<StoredStream>* streams) {
  RIGCAL_ASSIGN_OR_RETURN(const int64_t number, SessionNumber(database, session_id));
  if (!camera.empty()) RIGCAL_RETURN_IF_ERROR(CameraId(database, session_id, camera).status());
  SQLite::Statement query = Query(database,
                                  "SELECT s.id, c.camera, s.stream_epoch FROM session_camera c "
                                  "JOIN stream s ON s.camera_id=c.id "
                                  "WHERE c.session_number=?1 AND (?2='' OR c.camera=?2) "
                                  "ORDER BY c.camera, s.stream_epoch",
                                  number, camera);
  while (query.executeStep()) {
    streams->push_back({.id = query.getColumn(0).getInt64(),
                        .key = {.session_id = std::string(session_id),
                                .camera = query.getColumn(1).getString(),
                                .stream_epoch = ColumnUint32(query, 2)}});
  }
  return absl::OkStatus();
}

// Implausible ones were counted as refused when they came and are left out here.
void LoadClockReadings(SQLite::Database& database, int64_t stream_id, ReadingsByEpoch* readings) {
  SQLite::Statement samples = Query(
      database,
      "SELECT clock_epoch, late, device_ns, host_monotonic_ns, host_utc_ns, uncertainty_ns "
      "FROM clock_sample WHERE stream_id=? AND plausible ORDER BY clock_epoch, host_monotonic_ns, "
      "device_ns, host_utc_ns, uncertainty_ns",
      stream_id);
  while (samples.executeStep()) {
    (*readings)[{ColumnUint32(samples, 0), samples.getColumn(1).getInt() != 0}].samples.push_back(
        {.device_ns = samples.getColumn(2).getInt64(),
         .host_monotonic_ns = samples.getColumn(3).getInt64(),
         .host_utc_ns = samples.getColumn(4).getInt64(),
         .uncertainty_ns = ColumnUint32(samples, 5)});
  }
  SQLite::Statement alignments =
      Query(database,
            "SELECT clock_epoch, late, host_monotonic_ns, server_minus_host_ns, uncertainty_ns "
            "FROM host_alignment WHERE stream_id=? AND plausible ORDER BY clock_epoch, "
            "host_monotonic_ns, server_minus_host_ns, uncertainty_ns",
            stream_id);
  while (alignments.executeStep()) {
    (*readings)[{ColumnUint32(alignments, 0), alignments.getColumn(1).getInt() != 0}]
        .alignments.push_back({.host_monotonic_ns = alignments.getColumn(2).getInt64(),
                               .server_minus_host_ns = alignments.getColumn(3).getInt64(),
                               .uncertainty_ns = ColumnUint32(alignments, 4)});
  }
}

// Batches of `stream` that begin after `after_seq`, as many as make a chunk; none: it has no more.
absl::Status LoadChunk(SQLite::Database& database, const StoredStream& stream, uint32_t after_seq,
                       std::vector<StoredBatch>* chunk) {
  if (!Query(database, "SELECT 1 FROM stream WHERE id=?", stream.id).executeStep()) {
    return absl::NotFoundError(
        absl::StrCat("session ", stream.key.session_id, " was deleted while it was being read"));
  }
  SQLite::Statement query = Query(database,
                                  "SELECT id & 0xffffffff, row_count, late, body FROM batch "
                                  "WHERE id > (?1<<32) + ?2 AND id <= (?1<<32) + 0xffffffff "
                                  "ORDER BY id LIMIT ?3",
                                  stream.id, after_seq, kChunkBatches);
  size_t bytes = 0;
  while (bytes < kChunkBytes && query.executeStep()) {
    const std::string_view blob = ColumnBytes(query, 3);
    RIGCAL_ASSIGN_OR_RETURN(StoredBatch stored,
                            DecodeBatch(blob, stream.key, ColumnUint32(query, 0)));
    if (stored.batch.rows() != ColumnUint32(query, 1)) {
      return absl::DataLossError(
          absl::StrCat("stored observations of session ", stream.key.session_id, ", camera ",
                       stream.key.camera, ", stream epoch ", stream.key.stream_epoch, ", from seq ",
                       stored.batch.first_seq, " are damaged: ", stored.batch.rows(),
                       " rows where ", ColumnUint32(query, 1), " are noted"));
    }
    stored.late = query.getColumn(2).getInt() != 0;
    bytes += blob.size();
    chunk->push_back(std::move(stored));
  }
  return absl::OkStatus();
}

void TakeReadings(ClockReadings readings, ObservationBatch* batch) {
  batch->clock_samples = std::move(readings.samples);
  batch->host_alignments = std::move(readings.alignments);
}

// Readings of clock epochs that have no rows at all.
absl::Status VisitLeftReadings(const StreamKey& key, ReadingsByEpoch readings,
                               const std::function<absl::Status(StoredBatch)>& visit) {
  for (auto& [epoch, left] : readings) {
    StoredBatch stored;
    stored.batch.stream = key;
    stored.batch.clock_epoch = epoch.first;
    stored.late = epoch.second;
    TakeReadings(std::move(left), &stored.batch);
    RIGCAL_RETURN_IF_ERROR(visit(std::move(stored)));
  }
  return absl::OkStatus();
}

absl::Status VisitStream(SqliteReader& reader, const StoredStream& stream,
                         const std::function<absl::Status(StoredBatch)>& visit) {
  ReadingsByEpoch readings;
  RIGCAL_RETURN_IF_ERROR(reader.Read(kWhat, [&](SQLite::Database& database) {
    LoadClockReadings(database, stream.id, &readings);
    return absl::OkStatus();
  }));
  uint32_t after_seq = 0;
  for (;;) {  // ends: after_seq grows
    std::vector<StoredBatch> chunk;
    RIGCAL_RETURN_IF_ERROR(reader.Read(kWhat, [&](SQLite::Database& database) {
      return LoadChunk(database, stream, after_seq, &chunk);
    }));
    if (chunk.empty()) return VisitLeftReadings(stream.key, std::move(readings), visit);
    after_seq = chunk.back().batch.first_seq;
    for (StoredBatch& stored : chunk) {
      const auto found = readings.find({stored.batch.clock_epoch, stored.late});
      if (found != readings.end()) {
        TakeReadings(std::move(found->second), &stored.batch);
        readings.erase(found);
      }
      RIGCAL_RETURN_IF_ERROR(visit(std::move(stored)));
    }
  }
}

}  // namespace

absl::Status ReadObservations(SqliteReader& reader, std::string_view session_id,
                              std::string_view camera,
                              const std::function<absl::Status(StoredBatch)>& visit) {
  std::vector<StoredStream> streams;
  RIGCAL_RETURN_IF_ERROR(reader.Read(kWhat, [&](SQLite::Database& database) {
    return ListStreams(database, session_id, camera, &streams);
  }));
  for (const StoredStream& stream : streams) {
    RIGCAL_RETURN_IF_ERROR(VisitStream(reader, stream, visit));
  }
  return absl::OkStatus();
}

absl::StatusOr<StreamStatus> ReadStreamStatus(SQLite::Database& database, const StreamKey& stream) {
  RIGCAL_ASSIGN_OR_RETURN(const int64_t camera_id,
                          CameraId(database, stream.session_id, stream.camera));
  for (const StreamStatus& status : ReadStreams(database, camera_id)) {
    if (status.stream_epoch == stream.stream_epoch) return status;
  }
  StreamStatus none;
  none.stream_epoch = stream.stream_epoch;
  return none;
}

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#include "server/store/sql/observation_reader.h"

#include <algorithm>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/store/batch_blob.h"
#include "server/store/sql/session_table.h"

namespace rigcal::server {
namespace {

constexpr char kWhat[] = "reading observations";
// Read at once, while other readers wait: a few milliseconds.
constexpr size_t kChunkBatches = 256;
constexpr size_t kFirstChunkBatches = 8;  // of a stream, whose batches may be large
constexpr size_t kChunkBytes = 1u << 20;

struct StoredStream {
  int64_t id = 0;
  int64_t camera_id = 0;
  uint32_t durable_seq = 0;
  StreamKey key;
};

// Clock samples and alignments of a stream that have not been handed out, by (clock epoch, late).
struct ClockReadings {
  std::vector<ClockSample> samples;
  std::vector<HostAlignment> alignments;
};
using ReadingsByEpoch = std::map<std::pair<uint32_t, bool>, ClockReadings>;

absl::StatusOr<int64_t> CameraId(SqlDatabase& database, std::string_view session_id,
                                 std::string_view camera) {
  RIGCAL_ASSIGN_OR_RETURN(const int64_t number, SessionNumber(database, session_id));
  SqlStatement query =
      Query(database, "SELECT id FROM session_camera WHERE session_number=? AND camera=?", number,
            camera);
  if (query.Step()) return query.Int64(0);
  return absl::NotFoundError(
      absl::StrCat("session ", std::string(session_id), " has no camera ", std::string(camera)));
}

absl::Status ListStreams(SqlDatabase& database, std::string_view session_id,
                         std::string_view camera, std::vector<StoredStream>* streams) {
  RIGCAL_ASSIGN_OR_RETURN(const int64_t number, SessionNumber(database, session_id));
  if (!camera.empty()) RIGCAL_RETURN_IF_ERROR(CameraId(database, session_id, camera).status());
  SqlStatement query = Query(database,
                             "SELECT s.id, c.camera, s.stream_epoch, c.id, s.durable_seq "
                             "FROM session_camera c "
                             "JOIN stream s ON s.camera_id=c.id "
                             "WHERE c.session_number=?1 AND (?2='' OR c.camera=?2) "
                             "ORDER BY c.camera, s.stream_epoch",
                             number, camera);
  while (query.Step()) {
    streams->push_back({.id = query.Int64(0),
                        .camera_id = query.Int64(3),
                        .durable_seq = query.Uint32(4),
                        .key = {.session_id = std::string(session_id),
                                .camera = query.Text(1),
                                .stream_epoch = query.Uint32(2)}});
  }
  return absl::OkStatus();
}

// Implausible ones were counted as refused when they came and are left out here.
void LoadClockReadings(SqlDatabase& database, int64_t stream_id, ReadingsByEpoch* readings) {
  SqlStatement samples =
      Query(database,
            "SELECT clock_epoch, late, device_ns, host_monotonic_ns, host_utc_ns, uncertainty_ns "
            "FROM clock_sample WHERE stream_id=? AND plausible<>0 ORDER BY clock_epoch, "
            "host_monotonic_ns, "
            "device_ns, host_utc_ns, uncertainty_ns",
            stream_id);
  while (samples.Step()) {
    (*readings)[{samples.Uint32(0), samples.Int64(1) != 0}].samples.push_back(
        {.device_ns = samples.Int64(2),
         .host_monotonic_ns = samples.Int64(3),
         .host_utc_ns = samples.Int64(4),
         .uncertainty_ns = samples.Uint32(5)});
  }
  SqlStatement lights = Query(
      database,
      "SELECT clock_epoch, late, device_ns, light, light_ns, uncertainty_ns FROM light_sample "
      "WHERE stream_id=? AND plausible<>0 ORDER BY clock_epoch, device_ns, light, light_ns, "
      "uncertainty_ns",
      stream_id);
  while (lights.Step()) {
    (*readings)[{lights.Uint32(0), lights.Int64(1) != 0}].samples.push_back(
        {.device_ns = lights.Int64(2),
         .uncertainty_ns = lights.Uint32(5),
         .light = lights.Uint32(3),
         .light_ns = lights.Int64(4)});
  }
  SqlStatement alignments =
      Query(database,
            "SELECT clock_epoch, late, host_monotonic_ns, server_minus_host_ns, uncertainty_ns "
            "FROM host_alignment WHERE stream_id=? AND plausible<>0 ORDER BY clock_epoch, "
            "host_monotonic_ns, server_minus_host_ns, uncertainty_ns",
            stream_id);
  while (alignments.Step()) {
    (*readings)[{alignments.Uint32(0), alignments.Int64(1) != 0}].alignments.push_back(
        {.host_monotonic_ns = alignments.Int64(2),
         .server_minus_host_ns = alignments.Int64(3),
         .uncertainty_ns = alignments.Uint32(4)});
  }
}

StoredBatch DamagedBatch(const StoredStream& stream, uint32_t first_seq, uint32_t row_count,
                         std::string damage) {
  StoredBatch stored;
  stored.batch.stream = stream.key;
  stored.batch.first_seq = first_seq;
  stored.damaged_rows = std::clamp<uint32_t>(row_count, 1, kMaxBatchRows);
  stored.damage = std::move(damage);
  return stored;
}

// The batch of a row (first_seq, row_count, late, body). Of the two numbers of rows the one in the
// body counts, which has a checksum.
StoredBatch ReadBatch(SqlStatement& row, const StoredStream& stream) {
  const uint32_t first_seq = row.Uint32(0);
  const uint32_t row_count = row.Uint32(1);
  absl::StatusOr<StoredBatch> stored = DecodeBatch(row.Bytes(3), stream.key, first_seq);
  if (!stored.ok()) {
    return DamagedBatch(stream, first_seq, row_count, std::string(stored.status().message()));
  }
  stored->late = row.Int64(2) != 0;
  return *std::move(stored);
}

// At most `limit` batches of `stream` that begin after `after_seq`; none: it has no more.
// With an error, `chunk` has those before it.
// `bytes`: what they take in the database.
absl::Status LoadChunk(SqlDatabase& database, const StoredStream& stream, uint32_t after_seq,
                       size_t limit, std::vector<StoredBatch>* chunk, size_t* bytes) {
  if (!Query(database, "SELECT 1 FROM stream WHERE id=?", stream.id).Step()) {
    return absl::NotFoundError(
        absl::StrCat("session ", stream.key.session_id, " was deleted while it was being read"));
  }
  SqlStatement query = Query(database,
                             "SELECT id & 4294967295, row_count, late, body FROM batch "
                             "WHERE id > (?1<<32) + ?2 AND id <= (?1<<32) + 4294967295 "
                             "ORDER BY id LIMIT ?3",
                             stream.id, after_seq, limit);
  while (*bytes < kChunkBytes && query.Step()) {
    *bytes += query.Bytes(3).size();
    chunk->push_back(ReadBatch(query, stream));
  }
  return absl::OkStatus();
}

// The first batch from `seq` on; none: there is none. DATA_LOSS: a page of the database on the way
// to it is damaged.
absl::StatusOr<std::optional<uint32_t>> FindBatchFrom(SqlReader& reader, const StoredStream& stream,
                                                      uint32_t seq) {
  return reader.Read(kWhat, [&](SqlDatabase& database) -> absl::StatusOr<std::optional<uint32_t>> {
    SqlStatement query = Query(database,
                               "SELECT id & 4294967295 FROM batch WHERE id >= (?1<<32) + ?2 AND "
                               "id <= (?1<<32) + 4294967295 ORDER BY id LIMIT 1",
                               stream.id, seq);
    if (!query.Step()) return std::optional<uint32_t>();
    return std::optional<uint32_t>(query.Uint32(0));
  });
}

// Behind a damaged page of the database: what cannot be read, as one damaged batch that begins at
// `first_seq` and ends where reading is possible again.
StoredBatch SkipDamagedPage(SqlReader& reader, const StoredStream& stream, uint32_t first_seq,
                            const absl::Status& damage) {
  uint32_t bad = first_seq;
  uint64_t good = uint64_t{std::max(stream.durable_seq, first_seq)} + 1;
  while (bad + 1 < good) {  // ends: the interval is halved
    const auto middle = static_cast<uint32_t>(bad + (good - bad) / 2);
    const absl::StatusOr<std::optional<uint32_t>> found = FindBatchFrom(reader, stream, middle);
    if (found.ok()) {
      good = middle;
    } else {
      bad = middle;
    }
  }
  const absl::StatusOr<std::optional<uint32_t>> next =
      FindBatchFrom(reader, stream, static_cast<uint32_t>(good));
  const uint32_t end = next.ok() && next->has_value() ? **next : static_cast<uint32_t>(good);
  return DamagedBatch(
      stream, first_seq, end - first_seq,
      absl::StrCat("stored observations of session ", stream.key.session_id, ", camera ",
                   stream.key.camera, ", stream epoch ", stream.key.stream_epoch, ", seq ",
                   first_seq, " to ", end - 1, " cannot be read: ", std::string(damage.message())));
}

void TakeReadings(ClockReadings readings, ObservationBatch* batch) {
  batch->clock_samples = std::move(readings.samples);
  batch->host_alignments = std::move(readings.alignments);
}

// Goes through the streams, and through each chunk by chunk.
class SqlObservationCursor final : public ObservationCursor {
 public:
  SqlObservationCursor(SqlReader* reader, std::vector<StoredStream> streams,
                       NoteDamaged note_damaged)
      : reader_(*reader),
        note_damaged_(std::move(note_damaged)),
        streams_(streams.begin(), streams.end()) {}
  ~SqlObservationCursor() override { NoteDamagedBatches(); }

  absl::StatusOr<std::optional<StoredBatch>> Next() override {
    while (chunk_.empty()) {
      if (!in_stream_ && streams_.empty()) return std::nullopt;
      RIGCAL_RETURN_IF_ERROR(in_stream_ ? ReadOn() : BeginStream());
    }
    StoredBatch stored = std::move(chunk_.front());
    chunk_.pop_front();
    return stored;
  }

 private:
  absl::Status BeginStream() {
    in_stream_ = true;
    after_seq_ = 0;
    chunk_limit_ = kFirstChunkBatches;
    return reader_.Read(kWhat, [&](SqlDatabase& database) {
      readings_.clear();
      LoadClockReadings(database, streams_.front().id, &readings_);
      return absl::OkStatus();
    });
  }

  absl::Status ReadOn() {
    const StoredStream& stream = streams_.front();
    std::vector<StoredBatch> chunk;
    size_t bytes = 0;
    const absl::Status read = reader_.Read(kWhat, [&](SqlDatabase& database) {
      chunk.clear();
      bytes = 0;
      return LoadChunk(database, stream, after_seq_, chunk_limit_, &chunk, &bytes);
    });
    // A database may read all that it is asked for before it gives the first.
    if (!chunk.empty()) {
      chunk_limit_ = std::clamp<size_t>(kChunkBytes * chunk.size() / std::max<size_t>(bytes, 1), 1,
                                        kChunkBatches);
    }
    const bool damaged_page = absl::IsDataLoss(read);
    if (!read.ok() && !damaged_page) return read;
    if (damaged_page && chunk.empty() && chunk_limit_ > 1) {
      chunk_limit_ = 1;  // what can be read before the damage is read one by one
      return absl::OkStatus();
    }
    const bool last = read.ok() && chunk.empty();
    uint32_t next_seq = after_seq_ + 1;
    for (StoredBatch& stored : chunk) {
      after_seq_ = stored.batch.first_seq;
      next_seq = after_seq_ + static_cast<uint32_t>(stored.batch.rows()) + stored.damaged_rows;
      Take(std::move(stored));
    }
    if (last || (damaged_page && next_seq > stream.durable_seq)) {
      EndStream();
    } else if (damaged_page) {
      StoredBatch lost = SkipDamagedPage(reader_, stream, next_seq, read);
      after_seq_ = next_seq + lost.damaged_rows - 1;
      Take(std::move(lost));
    }
    return absl::OkStatus();
  }

  // The first of a clock epoch gets its readings; a damaged one is noted.
  void Take(StoredBatch stored) {
    if (stored.damaged_rows > 0) {
      damaged_.push_back({.batch_id = (streams_.front().id << 32) + stored.batch.first_seq,
                          .camera_id = streams_.front().camera_id,
                          .row_count = stored.damaged_rows,
                          .example = stored.damage});
    } else if (const auto found = readings_.find({stored.batch.clock_epoch, stored.late});
               found != readings_.end()) {
      TakeReadings(std::move(found->second), &stored.batch);
      readings_.erase(found);
    }
    chunk_.push_back(std::move(stored));
  }

  void EndStream() {
    // Readings of clock epochs that have no rows at all.
    for (auto& [epoch, left] : readings_) {
      StoredBatch& stored = chunk_.emplace_back();
      stored.batch.stream = streams_.front().key;
      stored.batch.clock_epoch = epoch.first;
      stored.late = epoch.second;
      TakeReadings(std::move(left), &stored.batch);
    }
    readings_.clear();
    streams_.pop_front();
    in_stream_ = false;
    NoteDamagedBatches();
  }

  void NoteDamagedBatches() {
    if (!damaged_.empty()) note_damaged_(std::exchange(damaged_, {}));
  }

  SqlReader& reader_;
  const NoteDamaged note_damaged_;
  std::deque<StoredStream> streams_;  // the one being read, and those after it
  bool in_stream_ = false;
  uint32_t after_seq_ = 0;
  size_t chunk_limit_ = kFirstChunkBatches;
  ReadingsByEpoch readings_;
  std::deque<StoredBatch> chunk_;
  std::vector<DamageNote> damaged_;  // not noted yet
};

}  // namespace

absl::StatusOr<std::unique_ptr<ObservationCursor>> OpenObservations(SqlReader& reader,
                                                                    std::string_view session_id,
                                                                    std::string_view camera,
                                                                    NoteDamaged note_damaged) {
  std::vector<StoredStream> streams;
  RIGCAL_RETURN_IF_ERROR(reader.Read(kWhat, [&](SqlDatabase& database) {
    streams.clear();
    return ListStreams(database, session_id, camera, &streams);
  }));
  return std::make_unique<SqlObservationCursor>(&reader, std::move(streams),
                                                std::move(note_damaged));
}

absl::StatusOr<StreamStatus> ReadStreamStatus(SqlDatabase& database, const StreamKey& stream) {
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

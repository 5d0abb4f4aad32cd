// SPDX-License-Identifier: Apache-2.0
#include "server/store/sql/replica_reader.h"

#include <algorithm>
#include <map>
#include <set>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/store/sql/session_table.h"
#include "server/store/sql/stored_tables.h"

namespace rigcal::server {
namespace {

// Of batches in one read: some milliseconds, between which others read.
constexpr size_t kBytesAtOnce = 1u << 20;
constexpr uint32_t kFinished = static_cast<uint32_t>(SessionState::kFinished);

constexpr const char* kSampleTables[] = {"clock_sample", "light_sample", "host_alignment"};
// What orders the samples of a stream, after the clock epoch.
constexpr const char* kSampleTimes[] = {"host_monotonic_ns", "device_ns", "host_monotonic_ns"};

bool BelongsTo(const StoredTable& table, ReplicaKind kind) {
  switch (kind) {
    case ReplicaKind::kShared:
      return table.owner == TableOwner::kShared;
    case ReplicaKind::kSession:
      return table.owner == TableOwner::kSession;
    case ReplicaKind::kCalibration:
      return table.owner == TableOwner::kCalibration;
    case ReplicaKind::kActivations:
      return table.owner == TableOwner::kActivations;
  }
  return false;
}

ReplicaRow TakeRow(const StoredTable& table, SqlStatement& row) {
  ReplicaRow taken;
  int column = 0;
  for (; column < table.number_count(); ++column) {
    taken.numbers.push_back(row.Int64(column));
    if (row.IsNull(column)) taken.without_value |= 1u << static_cast<unsigned>(column);
  }
  for (; column < table.column_count(); ++column) taken.values.push_back(row.Text(column));
  return taken;
}

template <typename... Values>
ReplicaRows ReadRows(SqlDatabase& database, const StoredTable& table, const std::string& condition,
                     const Values&... values) {
  ReplicaRows read{.table = table.name, .rows = {}};
  SqlStatement row = Query(database,
                           absl::StrCat("SELECT ", table.Columns(), " FROM ", table.name,
                                        condition.empty() ? "" : " WHERE ", condition),
                           values...);
  while (row.Step()) read.rows.push_back(TakeRow(table, row));
  return read;
}

std::vector<int64_t> StreamNumbers(SqlDatabase& database, const std::string& id) {
  std::vector<int64_t> numbers;
  SqlStatement row = Query(database,
                           "SELECT t.id FROM stream t JOIN session_camera c ON t.camera_id=c.id "
                           "JOIN session s ON c.session_number=s.number WHERE s.id=? ORDER BY t.id",
                           id);
  while (row.Step()) numbers.push_back(row.Int64(0));
  return numbers;
}

// Batches behind those that the standby has, and moves `stream` on. False: there may be more.
bool ReadBatches(SqlDatabase& database, ReplicaStream* stream, size_t* budget, ReplicaRows* out) {
  const StoredTable& table = *FindStoredTable("batch");
  SqlStatement row = Query(
      database,
      absl::StrCat("SELECT ", table.Columns(),
                   " FROM batch WHERE id>(?1<<32)+?2 AND id<=(?1<<32)+4294967295 ORDER BY id"),
      stream->number, stream->durable_seq);
  while (row.Step()) {
    if (*budget == 0) return false;
    out->rows.push_back(TakeRow(table, row));
    const ReplicaRow& taken = out->rows.back();
    *budget -= std::min(*budget, taken.values[0].size() + 64);
    // Not the end of the batch: those of a stream do not overlap, so its first number will do.
    stream->durable_seq = static_cast<uint32_t>(taken.numbers[0] & 0xffffffff);
  }
  return true;
}

ReplicaSamples MarkOf(SqlDatabase& database, size_t kind, int64_t stream) {
  ReplicaSamples mark;
  SqlStatement count = Query(
      database, absl::StrCat("SELECT count(*) FROM ", kSampleTables[kind], " WHERE stream_id=?"),
      stream);
  if (count.Step()) mark.count = count.Uint64(0);
  const char* const time = kSampleTimes[kind];
  SqlStatement last =
      Query(database,
            absl::StrCat("SELECT clock_epoch, ", time, " FROM ", kSampleTables[kind],
                         " WHERE stream_id=? ORDER BY clock_epoch DESC, ", time, " DESC LIMIT 1"),
            stream);
  if (last.Step()) {
    mark.clock_epoch = last.Int64(0);
    mark.time_ns = last.Int64(1);
  }
  return mark;
}

// Samples are added in the order of time but for a few; those that are not are found by the count.
ReplicaRows ReadSamples(SqlDatabase& database, size_t kind, const ReplicaStream& stream) {
  const StoredTable& table = *FindStoredTable(kSampleTables[kind]);
  const ReplicaSamples& known = stream.samples[kind];
  const ReplicaSamples now = MarkOf(database, kind, stream.number);
  if (now.count == 0) return {.table = table.name, .rows = {}};
  if (known.count > 0) {
    ReplicaRows behind =
        ReadRows(database, table,
                 absl::StrCat("stream_id=? AND (clock_epoch, ", kSampleTimes[kind], ")>=(?, ?)"),
                 stream.number, known.clock_epoch, known.time_ns);
    // Those at the last time itself are there already, or not all of them.
    if (known.count == now.count) return {.table = table.name, .rows = {}};
    if (known.count + behind.rows.size() >= now.count &&
        known.count + behind.rows.size() <= now.count + 1) {
      return behind;
    }
  }
  return ReadRows(database, table, "stream_id=?", stream.number);
}

bool IsFinished(SqlDatabase& database, const std::string& id) {
  SqlStatement row = Query(database, "SELECT state FROM session WHERE id=?", id);
  return row.Step() && row.Uint32(0) == kFinished;
}

ReplicaDigest DigestOf(SqlDatabase& database, const StoredTable& table,
                       const std::vector<int64_t>& streams) {
  ReplicaDigest digest{.table = table.name};
  const bool is_batch = std::string_view(table.name) == "batch";
  for (const int64_t stream : streams) {
    SqlStatement row = Query(
        database,
        absl::StrCat("SELECT ", is_batch ? "id,row_count,late,length(body)" : table.Columns(),
                     " FROM ", table.name, " WHERE ", table.of_record, " ORDER BY ", table.key),
        stream);
    while (row.Step()) {
      ++digest.row_count;
      if (!is_batch) {
        AddToDigest(table, row, &digest.digest);
        continue;
      }
      for (int column = 0; column < 4; ++column) {
        const int64_t number = row.Int64(column);
        AddToDigest({reinterpret_cast<const char*>(&number), sizeof(number)}, &digest.digest);
      }
    }
  }
  return digest;
}

absl::Status NoSuchRecord(ReplicaKind kind, const std::string& id) {
  return absl::NotFoundError(
      absl::StrCat("no ", kind == ReplicaKind::kSession ? "session " : "calibration ", id));
}

// A part of a record. The last one has the rest.
struct Part {
  std::vector<ReplicaRows> rows;
  std::vector<ReplicaStream> streams;
  std::vector<ReplicaDigest> digests;
  bool last = false;
};

absl::StatusOr<Part> ReadPart(SqlDatabase& database, ReplicaKind kind, const std::string& id,
                              const std::vector<ReplicaStream>& known) {
  Part part;
  if (kind == ReplicaKind::kSession || kind == ReplicaKind::kCalibration) {
    const char* const table = kind == ReplicaKind::kSession ? "session" : "calibration";
    if (!Query(database, absl::StrCat("SELECT 1 FROM ", table, " WHERE id=?"), id).Step()) {
      return NoSuchRecord(kind, id);
    }
  }
  if (kind == ReplicaKind::kSession) {
    std::map<int64_t, ReplicaStream> by_number;
    for (const ReplicaStream& stream : known) by_number[stream.number] = stream;
    size_t budget = kBytesAtOnce;
    bool complete = true;
    ReplicaRows batches{.table = "batch", .rows = {}};
    for (const int64_t number : StreamNumbers(database, id)) {
      ReplicaStream& stream = by_number[number];
      stream.number = number;
      complete = complete && ReadBatches(database, &stream, &budget, &batches);
      part.streams.push_back(stream);
    }
    part.rows.push_back(std::move(batches));
    if (!complete) return part;
  }
  for (const StoredTable& table : StoredTables()) {
    if (!BelongsTo(table, kind)) continue;
    const std::string condition = table.of_record;
    part.rows.push_back(condition.empty() ? ReadRows(database, table, "")
                                          : ReadRows(database, table, condition, id));
  }
  // They refer to streams.
  for (const ReplicaStream& stream : part.streams) {
    for (size_t i = 0; i < std::size(kSampleTables); ++i) {
      part.rows.push_back(ReadSamples(database, i, stream));
    }
  }
  part.digests = DigestReplica(database, kind, id);
  part.last = true;
  return part;
}

}  // namespace

uint64_t ReadGeneration(SqlDatabase& database) {
  SqlStatement row = Query(database, "SELECT value FROM counter WHERE name=?", kGenerationCounter);
  return 1 + (row.Step() ? row.Uint64(0) : 0);
}

std::vector<StreamProgress> ReadReplicaProgress(SqlDatabase& database, const std::string& id) {
  std::vector<StreamProgress> progress;
  SqlStatement row = Query(database,
                           "SELECT c.camera, t.stream_epoch, t.durable_seq, t.last_seq FROM stream "
                           "t JOIN session_camera c ON t.camera_id=c.id JOIN session s ON "
                           "c.session_number=s.number WHERE s.id=? ORDER BY t.id",
                           id);
  while (row.Step()) {
    progress.push_back({.stream = {id, row.Text(0), row.Uint32(1)},
                        .durable_seq = row.Uint32(2),
                        .complete = !row.IsNull(3) && row.Uint32(2) >= row.Uint32(3)});
  }
  return progress;
}

ReplicaListing ListReplica(SqlDatabase& database) {
  ReplicaListing listing;
  // Everything that can change of a session whose body stays the same grows one of these sums.
  SqlStatement sums(
      database,
      "SELECT CAST(coalesce(sum(c.observation_count+c.wand_count+c.late_count), 0) AS BIGINT), "
      "(SELECT CAST(coalesce(sum(r.count), 0) AS BIGINT) FROM refusal_count r JOIN session_camera "
      "k ON r.camera_id=k.id WHERE k.session_number=?1), "
      "(SELECT CAST(coalesce(sum(t.durable_seq+coalesce(t.last_seq, 0)+"
      "t.report_observation_count), 0) AS BIGINT) FROM stream t JOIN session_camera k ON "
      "t.camera_id=k.id WHERE k.session_number=?1), "
      "(SELECT CAST(coalesce(sum(p.count), 0) AS BIGINT) FROM report_count p JOIN stream t ON "
      "p.stream_id=t.id JOIN session_camera k ON t.camera_id=k.id WHERE k.session_number=?1) "
      "FROM session_camera c WHERE c.session_number=?1");
  SqlStatement session(database, "SELECT id, number, state, checksum FROM session ORDER BY number");
  while (session.Step()) {
    ReplicaRecord record{.id = session.Text(0)};
    const int64_t number = session.Int64(1);
    const auto add = [&](int64_t value) {
      AddToDigest({reinterpret_cast<const char*>(&value), sizeof(value)}, &record.mark);
    };
    for (int column = 1; column < 4; ++column) add(session.Int64(column));
    const StatementScope scope(sums);
    BindAll(sums, number);
    sums.Step();
    for (int column = 0; column < 4; ++column) add(sums.Int64(column));
    listing.sessions.push_back(std::move(record));
  }
  for (ReplicaRecord& record : listing.sessions) {
    record.streams = ReadReplicaProgress(database, record.id);
  }
  SqlStatement calibration(database,
                           "SELECT id, number, state, checksum FROM calibration ORDER BY number");
  while (calibration.Step()) {
    ReplicaRecord record{.id = calibration.Text(0)};
    for (int column = 1; column < 4; ++column) {
      const int64_t value = calibration.Int64(column);
      AddToDigest({reinterpret_cast<const char*>(&value), sizeof(value)}, &record.mark);
    }
    listing.calibrations.push_back(std::move(record));
  }
  SqlStatement deleted(database, "SELECT id FROM deleted_session");
  while (deleted.Step()) listing.deleted_sessions.push_back(deleted.Text(0));
  return listing;
}

std::vector<ReplicaStream> ReadReplicaStreams(SqlDatabase& database, const std::string& id) {
  std::vector<ReplicaStream> streams;
  SqlStatement position(database, "SELECT durable_seq FROM stream WHERE id=?");
  for (const int64_t number : StreamNumbers(database, id)) {
    const StatementScope scope(position);
    BindAll(position, number);
    ReplicaStream stream{.number = number, .durable_seq = position.Step() ? position.Uint32(0) : 0};
    for (size_t i = 0; i < std::size(kSampleTables); ++i) {
      stream.samples[i] = MarkOf(database, i, number);
    }
    streams.push_back(stream);
  }
  return streams;
}

std::vector<ReplicaDigest> DigestReplica(SqlDatabase& database, ReplicaKind kind,
                                         const std::string& id) {
  std::vector<ReplicaDigest> digests;
  for (const StoredTable& table : StoredTables()) {
    if (!BelongsTo(table, kind)) continue;
    ReplicaDigest digest{.table = table.name};
    const std::string condition = table.of_record;
    const std::string sql =
        absl::StrCat("SELECT ", table.Columns(), " FROM ", table.name,
                     condition.empty() ? "" : " WHERE ", condition, " ORDER BY ", table.key);
    SqlStatement row = condition.empty() ? Query(database, sql) : Query(database, sql, id);
    while (row.Step()) {
      ++digest.row_count;
      AddToDigest(table, row, &digest.digest);
    }
    digests.push_back(digest);
  }
  if (kind != ReplicaKind::kSession || !IsFinished(database, id)) return digests;
  const std::vector<int64_t> streams = StreamNumbers(database, id);
  for (const StoredTable& table : StoredTables()) {
    if (table.owner == TableOwner::kStreams) digests.push_back(DigestOf(database, table, streams));
  }
  return digests;
}

absl::StatusOr<std::vector<ReplicaDigest>> ReadReplica(
    SqlReader& reader, ReplicaKind kind, const std::string& id, std::vector<ReplicaStream> streams,
    const std::function<absl::Status(std::vector<ReplicaRows>)>& take) {
  while (true) {
    RIGCAL_ASSIGN_OR_RETURN(Part part,
                            reader.Read("reading for a standby", [&](SqlDatabase& database) {
                              return ReadPart(database, kind, id, streams);
                            }));
    RIGCAL_RETURN_IF_ERROR(take(std::move(part.rows)));
    if (part.last) return std::move(part.digests);
    streams = std::move(part.streams);
  }
}

}  // namespace rigcal::server

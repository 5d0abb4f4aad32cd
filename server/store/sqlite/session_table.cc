// SPDX-License-Identifier: Apache-2.0
#include "server/store/sqlite/session_table.h"

#include <string>
#include <utility>

#include "absl/container/flat_hash_set.h"
#include "absl/strings/str_format.h"
#include "common/status/validate_name.h"
#include "common/wire/session_wire.h"
#include "server/store/sqlite/record_table.h"
#include "server/store/sqlite/sqlite_schema.h"

namespace rigcal::server {
namespace {

constexpr char kSession[] = "session";

bool IsIdTaken(SQLite::Database& database, std::string_view id) {
  return Query(database, "SELECT 1 FROM session WHERE id=?", id).executeStep();
}

bool WasIdDeleted(SQLite::Database& database, std::string_view id) {
  return Query(database, "SELECT 1 FROM deleted_session WHERE id=?", id).executeStep();
}

std::string NewSessionId(SQLite::Database& database) {
  std::string id;
  do {  // ends: only sessions with ids given by hand can be in the way
    id = absl::StrFormat("s-%06d", NextNumber(database, "session_id"));
  } while (IsIdTaken(database, id) || WasIdDeleted(database, id));
  return id;
}

// Makes session_camera hold exactly the session's cameras.
absl::Status SyncCameras(SQLite::Database& database, int64_t number, const Session& session) {
  absl::flat_hash_set<std::string> stored;
  SQLite::Statement query =
      Query(database,
            "SELECT camera, EXISTS(SELECT 1 FROM stream WHERE camera_id=c.id) "
            "FROM session_camera c WHERE session_number=?",
            number);
  while (query.executeStep()) {
    std::string camera = query.getColumn(0).getString();
    const bool has_streams = query.getColumn(1).getInt() != 0;
    if (session.FindCamera(camera) == nullptr && has_streams) {
      return absl::FailedPreconditionError(absl::StrCat(
          "session ", session.id, " cannot lose camera ", camera, ": it has observations of it"));
    }
    stored.insert(std::move(camera));
  }
  SQLite::Statement insert(database,
                           "INSERT INTO session_camera(session_number, camera) VALUES(?,?)");
  for (const SessionCamera& camera : session.cameras) {
    if (stored.erase(camera.description.camera) > 0) continue;
    Execute(insert, number, camera.description.camera);
  }
  SQLite::Statement erase(database,
                          "DELETE FROM session_camera WHERE session_number=? AND camera=?");
  for (const std::string& camera : stored) Execute(erase, number, camera);
  return absl::OkStatus();
}

absl::StatusOr<SessionSummary> ParseSessionSummary(std::string_view body) {
  RIGCAL_ASSIGN_OR_RETURN(Session session, wire::ParseSession(body));
  return SessionSummary{.session = std::move(session)};
}

Session WithoutCameras(Session session) {
  session.cameras.clear();
  session.requested_cameras.clear();
  session.missing_cameras.clear();
  return session;
}

absl::StatusOr<SessionSummary> SummarizeSession(SQLite::Database& database, std::string_view id) {
  RIGCAL_ASSIGN_OR_RETURN(Session session, FindSession(database, id));
  return SessionSummary{.session = WithoutCameras(std::move(session))};
}

SessionSummary BlankSession(SQLite::Statement& row) {
  SessionSummary summary;
  summary.session.id = row.getColumn(0).getString();
  summary.session.rig = row.getColumn(4).getString();
  summary.session.state = static_cast<SessionState>(row.getColumn(5).getInt());
  return summary;
}

constexpr SummarySource<SessionSummary> kSessionSummaries = {.table = kSession,
                                                             .more = "0",
                                                             .parse = ParseSessionSummary,
                                                             .summarize = SummarizeSession,
                                                             .blank = BlankSession};

void PutSessionSummary(SQLite::Database& database, int64_t number, const Session& session) {
  PutSummary(database, kSession, number, wire::SerializeSession(WithoutCameras(session)));
}

// Batches, clock samples and alignments of its streams.
void EraseStreamRows(SQLite::Database& database, int64_t session_number) {
  SQLite::Statement streams = Query(database,
                                    "SELECT s.id FROM stream s JOIN session_camera c ON "
                                    "s.camera_id=c.id WHERE c.session_number=?",
                                    session_number);
  SQLite::Statement erase_batches(
      database, "DELETE FROM batch WHERE id BETWEEN ?1<<32 AND (?1<<32)+0xffffffff");
  SQLite::Statement erase_samples(database, "DELETE FROM clock_sample WHERE stream_id=?");
  SQLite::Statement erase_lights(database, "DELETE FROM light_sample WHERE stream_id=?");
  SQLite::Statement erase_alignments(database, "DELETE FROM host_alignment WHERE stream_id=?");
  while (streams.executeStep()) {
    const int64_t stream = streams.getColumn(0).getInt64();
    Execute(erase_batches, stream);
    Execute(erase_samples, stream);
    Execute(erase_lights, stream);
    Execute(erase_alignments, stream);
  }
}

}  // namespace

absl::StatusOr<int64_t> SessionNumber(SQLite::Database& database, std::string_view id) {
  SQLite::Statement query = Query(database, "SELECT number FROM session WHERE id=?", id);
  if (!query.executeStep()) return NoRecord(kSession, id);
  return query.getColumn(0).getInt64();
}

absl::StatusOr<Session> InsertSession(SQLite::Database& database, Session session) {
  if (session.id.empty()) {
    session.id = NewSessionId(database);
  } else {
    RIGCAL_RETURN_IF_ERROR(ValidateName("session id", session.id));
    if (IsIdTaken(database, session.id)) {
      return absl::AlreadyExistsError(absl::StrCat("there is a session ", session.id, " already"));
    }
    if (WasIdDeleted(database, session.id)) {
      return absl::AlreadyExistsError(absl::StrCat(
          "there was a session ", session.id,
          ", since deleted; ids are not used twice: give another one, or none to get a new one"));
    }
  }
  const int64_t number = NextNumber(database, "session_number");
  const std::string body = wire::SerializeSession(session);
  Query(database, "INSERT INTO session(number, id, rig, state, body, checksum) VALUES(?,?,?,?,?,?)",
        number, session.id, session.rig, session.state, Blob{body}, Checksum(body))
      .exec();
  PutSessionSummary(database, number, session);
  RIGCAL_RETURN_IF_ERROR(SyncCameras(database, number, session));
  return session;
}

absl::Status ReplaceSession(SQLite::Database& database, const Session& session) {
  RIGCAL_ASSIGN_OR_RETURN(const int64_t number, SessionNumber(database, session.id));
  const std::string body = wire::SerializeSession(session);
  Query(database, "UPDATE session SET rig=?, state=?, body=?, checksum=? WHERE number=?",
        session.rig, session.state, Blob{body}, Checksum(body), number)
      .exec();
  PutSessionSummary(database, number, session);
  return SyncCameras(database, number, session);
}

absl::StatusOr<Session> FindSession(SQLite::Database& database, std::string_view id) {
  return FindRecord(database, kSession, id, wire::ParseSession);
}

std::vector<Listed<SessionSummary>> ListSessions(SQLite::Database& database,
                                                 const SessionFilter& filter,
                                                 const ListPage& page) {
  std::vector<RecordCondition> conditions;
  if (!filter.rig.empty()) conditions.push_back({"rig=?", std::string_view(filter.rig)});
  if (filter.state) conditions.push_back({"state=?", static_cast<int64_t>(*filter.state)});
  auto summaries = ListSummaries(database, kSessionSummaries, std::move(conditions), page);
  SQLite::Statement counts(database,
                           "SELECT count(*), coalesce(sum(observation_count), 0), "
                           "coalesce(sum(wand_count), 0), coalesce(sum(late_count), 0) "
                           "FROM session_camera WHERE session_number=?");
  for (auto& [summary, position] : summaries) {
    const StatementScope scope(counts);
    BindAll(counts, position.time);
    counts.executeStep();
    summary.camera_count = ColumnUint32(counts, 0);
    summary.observation_count = ColumnUint64(counts, 1);
    summary.wand_count = ColumnUint64(counts, 2);
    summary.late_count = ColumnUint64(counts, 3);
  }
  return summaries;
}

void SummarizeSessions(SQLite::Database& database) {
  SQLite::Statement row(database, "SELECT id, body, checksum, number FROM session");
  while (row.executeStep()) {
    const absl::StatusOr<Session> session = ParseRecord(row, kSession, wire::ParseSession);
    if (session.ok()) PutSessionSummary(database, row.getColumn(3).getInt64(), *session);
  }
}

absl::Status EraseSession(SQLite::Database& database, std::string_view id) {
  RIGCAL_ASSIGN_OR_RETURN(const int64_t number, SessionNumber(database, id));
  EraseStreamRows(database, number);
  Query(database, "DELETE FROM session WHERE number=?", number).exec();
  Query(database, "INSERT INTO deleted_session(id, number) VALUES(?,?)", id, number).exec();
  return absl::OkStatus();
}

absl::Status EraseObservations(SQLite::Database& database, std::string_view id, int64_t utc_ns) {
  RIGCAL_ASSIGN_OR_RETURN(const int64_t number, SessionNumber(database, id));
  RIGCAL_ASSIGN_OR_RETURN(Session session, FindSession(database, id));
  EraseStreamRows(database, number);
  session.observations_delete_utc_ns = utc_ns;
  return ReplaceSession(database, session);
}

}  // namespace rigcal::server

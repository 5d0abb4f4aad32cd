// SPDX-License-Identifier: Apache-2.0
#include "server/store/sql/session_table.h"

#include <string>
#include <utility>

#include "absl/container/flat_hash_set.h"
#include "absl/strings/str_format.h"
#include "common/status/validate_name.h"
#include "common/wire/session_wire.h"
#include "server/store/sql/counter_table.h"
#include "server/store/sql/record_table.h"

namespace rigcal::server {
namespace {

constexpr char kSession[] = "session";

bool IsIdTaken(SqlDatabase& database, std::string_view id) {
  return Query(database, "SELECT 1 FROM session WHERE id=?", id).Step();
}

bool WasIdDeleted(SqlDatabase& database, std::string_view id) {
  return Query(database, "SELECT 1 FROM deleted_session WHERE id=?", id).Step();
}

std::string NewSessionId(SqlDatabase& database) {
  std::string id;
  do {  // ends: only sessions with ids given by hand can be in the way
    id = absl::StrFormat("s-%06d", NextNumber(database, "session_id"));
  } while (IsIdTaken(database, id) || WasIdDeleted(database, id));
  return id;
}

// Makes session_camera hold exactly the session's cameras.
absl::Status SyncCameras(SqlDatabase& database, int64_t number, const Session& session) {
  absl::flat_hash_set<std::string> stored;
  SqlStatement query = Query(database,
                             "SELECT camera, EXISTS(SELECT 1 FROM stream WHERE camera_id=c.id) "
                             "FROM session_camera c WHERE session_number=?",
                             number);
  while (query.Step()) {
    std::string camera = query.Text(0);
    const bool has_streams = query.Int64(1) != 0;
    if (session.FindCamera(camera) == nullptr && has_streams) {
      return absl::FailedPreconditionError(absl::StrCat(
          "session ", session.id, " cannot lose camera ", camera, ": it has observations of it"));
    }
    stored.insert(std::move(camera));
  }
  SqlStatement insert(database, "INSERT INTO session_camera(session_number, camera) VALUES(?,?)");
  for (const SessionCamera& camera : session.cameras) {
    if (stored.erase(camera.description.camera) > 0) continue;
    Execute(insert, number, camera.description.camera);
  }
  SqlStatement erase(database, "DELETE FROM session_camera WHERE session_number=? AND camera=?");
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

absl::StatusOr<SessionSummary> SummarizeSession(SqlDatabase& database, std::string_view id) {
  RIGCAL_ASSIGN_OR_RETURN(Session session, FindSession(database, id));
  return SessionSummary{.session = WithoutCameras(std::move(session))};
}

SessionSummary BlankSession(SqlStatement& row) {
  SessionSummary summary;
  summary.session.id = row.Text(0);
  summary.session.rig = row.Text(4);
  summary.session.state = static_cast<SessionState>(row.Int64(5));
  return summary;
}

constexpr SummarySource<SessionSummary> kSessionSummaries = {.table = kSession,
                                                             .more = "0",
                                                             .parse = ParseSessionSummary,
                                                             .summarize = SummarizeSession,
                                                             .blank = BlankSession};

void PutSessionSummary(SqlDatabase& database, int64_t number, const Session& session) {
  PutSummary(database, kSession, number, wire::SerializeSession(WithoutCameras(session)));
}

}  // namespace

absl::StatusOr<int64_t> SessionNumber(SqlDatabase& database, std::string_view id) {
  SqlStatement query = Query(database, "SELECT number FROM session WHERE id=?", id);
  if (!query.Step()) return NoRecord(kSession, id);
  return query.Int64(0);
}

absl::StatusOr<Session> InsertSession(SqlDatabase& database, Session session) {
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
      .Run();
  PutSessionSummary(database, number, session);
  RIGCAL_RETURN_IF_ERROR(SyncCameras(database, number, session));
  return session;
}

absl::Status ReplaceSession(SqlDatabase& database, const Session& session) {
  RIGCAL_ASSIGN_OR_RETURN(const int64_t number, SessionNumber(database, session.id));
  const std::string body = wire::SerializeSession(session);
  Query(database, "UPDATE session SET rig=?, state=?, body=?, checksum=? WHERE number=?",
        session.rig, session.state, Blob{body}, Checksum(body), number)
      .Run();
  PutSessionSummary(database, number, session);
  return SyncCameras(database, number, session);
}

absl::StatusOr<Session> FindSession(SqlDatabase& database, std::string_view id) {
  return FindRecord(database, kSession, id, wire::ParseSession);
}

std::vector<Listed<SessionSummary>> ListSessions(SqlDatabase& database, const SessionFilter& filter,
                                                 const ListPage& page) {
  std::vector<RecordCondition> conditions;
  if (!filter.rig.empty()) conditions.push_back({"rig=?", std::string_view(filter.rig)});
  if (filter.state) conditions.push_back({"state=?", static_cast<int64_t>(*filter.state)});
  auto summaries = ListSummaries(database, kSessionSummaries, std::move(conditions), page);
  SqlStatement counts(
      database,
      "SELECT count(*), CAST(coalesce(sum(observation_count), 0) AS BIGINT), "
      "CAST(coalesce(sum(wand_count), 0) AS BIGINT), CAST(coalesce(sum(late_count), 0) AS BIGINT) "
      "FROM session_camera WHERE session_number=?");
  for (auto& [summary, position] : summaries) {
    const StatementScope scope(counts);
    BindAll(counts, position.time);
    counts.Step();
    summary.camera_count = counts.Uint32(0);
    summary.observation_count = counts.Uint64(1);
    summary.wand_count = counts.Uint64(2);
    summary.late_count = counts.Uint64(3);
  }
  return summaries;
}

void SummarizeSessions(SqlDatabase& database) {
  SqlStatement row(database, "SELECT id, body, checksum, number FROM session");
  while (row.Step()) {
    const absl::StatusOr<Session> session = ParseRecord(row, kSession, wire::ParseSession);
    if (session.ok()) PutSessionSummary(database, row.Int64(3), *session);
  }
}

void EraseStreamRows(SqlDatabase& database, std::string_view id) {
  SqlStatement streams = Query(database,
                               "SELECT t.id FROM stream t JOIN session_camera c ON "
                               "t.camera_id=c.id JOIN session s ON c.session_number=s.number "
                               "WHERE s.id=?",
                               id);
  SqlStatement erase_batches(database,
                             "DELETE FROM batch WHERE id BETWEEN (?1<<32) AND (?1<<32)+4294967295");
  SqlStatement erase_samples(database, "DELETE FROM clock_sample WHERE stream_id=?");
  SqlStatement erase_lights(database, "DELETE FROM light_sample WHERE stream_id=?");
  SqlStatement erase_alignments(database, "DELETE FROM host_alignment WHERE stream_id=?");
  while (streams.Step()) {
    const int64_t stream = streams.Int64(0);
    Execute(erase_batches, stream);
    Execute(erase_samples, stream);
    Execute(erase_lights, stream);
    Execute(erase_alignments, stream);
  }
}

absl::Status EraseSession(SqlDatabase& database, std::string_view id) {
  RIGCAL_ASSIGN_OR_RETURN(const int64_t number, SessionNumber(database, id));
  EraseStreamRows(database, id);
  Query(database, "DELETE FROM session WHERE number=?", number).Run();
  Query(database, "INSERT INTO deleted_session(id, number) VALUES(?,?)", id, number).Run();
  return absl::OkStatus();
}

absl::Status EraseObservations(SqlDatabase& database, std::string_view id, int64_t utc_ns) {
  RIGCAL_ASSIGN_OR_RETURN(Session session, FindSession(database, id));
  EraseStreamRows(database, id);
  session.observations_delete_utc_ns = utc_ns;
  return ReplaceSession(database, session);
}

}  // namespace rigcal::server

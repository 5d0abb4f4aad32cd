// SPDX-License-Identifier: Apache-2.0
#include "server/store/sqlite/session_table.h"

#include <string>
#include <utility>

#include "absl/container/flat_hash_set.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/status/status_macros.h"
#include "common/status/validate_name.h"
#include "common/wire/session_wire.h"
#include "server/store/sqlite/record_checksum.h"
#include "server/store/sqlite/record_table.h"
#include "server/store/sqlite/sqlite_connection.h"
#include "server/store/sqlite/sqlite_schema.h"

namespace rigcal::server {
namespace {

absl::Status NoSession(std::string_view id) {
  return absl::NotFoundError(absl::StrCat("no session ", std::string(id)));
}

bool IsInTable(SQLite::Database& database, const char* query_text, std::string_view id) {
  SQLite::Statement query(database, query_text);
  BindText(query, 1, id);
  return query.executeStep();
}

bool IsIdTaken(SQLite::Database& database, std::string_view id) {
  return IsInTable(database, "SELECT 1 FROM session WHERE id=?", id);
}

bool WasIdDeleted(SQLite::Database& database, std::string_view id) {
  return IsInTable(database, "SELECT 1 FROM deleted_session WHERE id=?", id);
}

std::string NewSessionId(SQLite::Database& database) {
  std::string id;
  do {  // ends: only sessions with ids given by hand can be in the way
    id = absl::StrFormat("s-%06d", NextNumber(database, "session_id"));
  } while (IsIdTaken(database, id) || WasIdDeleted(database, id));
  return id;
}

absl::StatusOr<Session> ParseSessionRow(SQLite::Statement& row) {
  return ParseRecord(row, "session", wire::ParseSession);
}

// Makes session_camera hold exactly the session's cameras.
absl::Status SyncCameras(SQLite::Database& database, int64_t number, const Session& session) {
  absl::flat_hash_set<std::string> stored;
  SQLite::Statement query(database,
                          "SELECT camera, EXISTS(SELECT 1 FROM stream WHERE camera_id=c.id) "
                          "FROM session_camera c WHERE session_number=?");
  query.bind(1, number);
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
    insert.bind(1, number);
    BindText(insert, 2, camera.description.camera);
    insert.exec();
    insert.reset();
  }
  SQLite::Statement erase(database,
                          "DELETE FROM session_camera WHERE session_number=? AND camera=?");
  for (const std::string& camera : stored) {
    erase.bind(1, number);
    BindText(erase, 2, camera);
    erase.exec();
    erase.reset();
  }
  return absl::OkStatus();
}

void EraseStreamRows(SQLite::Database& database, int64_t session_number) {
  SQLite::Statement streams(database,
                            "SELECT s.id FROM stream s JOIN session_camera c ON s.camera_id=c.id "
                            "WHERE c.session_number=?");
  SQLite::Statement erase(database, "DELETE FROM batch WHERE id BETWEEN ?<<32 AND (?<<32)+?");
  streams.bind(1, session_number);
  while (streams.executeStep()) {
    const int64_t stream_id = streams.getColumn(0).getInt64();
    erase.bind(1, stream_id);
    erase.bind(2, stream_id);
    erase.bind(3, int64_t{0xffffffff});
    erase.exec();
    erase.reset();
  }
}

}  // namespace

absl::StatusOr<int64_t> SessionNumber(SQLite::Database& database, std::string_view id) {
  SQLite::Statement query(database, "SELECT number FROM session WHERE id=?");
  BindText(query, 1, id);
  if (!query.executeStep()) return NoSession(id);
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
  SQLite::Statement insert(
      database, "INSERT INTO session(number, id, rig, state, body, checksum) VALUES(?,?,?,?,?,?)");
  insert.bind(1, number);
  BindText(insert, 2, session.id);
  BindText(insert, 3, session.rig);
  insert.bind(4, static_cast<int>(session.state));
  BindBlob(insert, 5, body);
  insert.bind(6, Checksum(body));
  insert.exec();
  RIGCAL_RETURN_IF_ERROR(SyncCameras(database, number, session));
  return session;
}

absl::Status ReplaceSession(SQLite::Database& database, const Session& session) {
  RIGCAL_ASSIGN_OR_RETURN(const int64_t number, SessionNumber(database, session.id));
  const std::string body = wire::SerializeSession(session);
  SQLite::Statement update(database,
                           "UPDATE session SET rig=?, state=?, body=?, checksum=? WHERE number=?");
  BindText(update, 1, session.rig);
  update.bind(2, static_cast<int>(session.state));
  BindBlob(update, 3, body);
  update.bind(4, Checksum(body));
  update.bind(5, number);
  update.exec();
  return SyncCameras(database, number, session);
}

absl::StatusOr<Session> FindSession(SQLite::Database& database, std::string_view id) {
  SQLite::Statement query(database, "SELECT id, body, checksum FROM session WHERE id=?");
  BindText(query, 1, id);
  if (!query.executeStep()) return NoSession(id);
  return ParseSessionRow(query);
}

absl::StatusOr<std::vector<Listed<Session>>> ListSessions(SQLite::Database& database,
                                                          const SessionFilter& filter,
                                                          const ListPage& page) {
  std::vector<RecordCondition> conditions;
  if (!filter.rig.empty()) conditions.push_back({"rig=?", std::string_view(filter.rig)});
  if (filter.state) conditions.push_back({"state=?", static_cast<int64_t>(*filter.state)});
  std::vector<Listed<Session>> sessions;
  const auto take = [&](SQLite::Statement& row, RecordPosition position) -> absl::Status {
    RIGCAL_ASSIGN_OR_RETURN(Session session, ParseSessionRow(row));
    sessions.push_back({std::move(session), std::move(position)});
    return absl::OkStatus();
  };
  RIGCAL_RETURN_IF_ERROR(ForEachRecord(database, "session", std::move(conditions), page, take));
  return sessions;
}

uint32_t CountSessions(SQLite::Database& database) {
  SQLite::Statement query(database, "SELECT count(*) FROM session");
  query.executeStep();
  return ColumnUint32(query, 0);
}

absl::Status EraseSession(SQLite::Database& database, std::string_view id) {
  RIGCAL_ASSIGN_OR_RETURN(const int64_t number, SessionNumber(database, id));
  EraseStreamRows(database, number);
  SQLite::Statement erase(database, "DELETE FROM session WHERE number=?");
  erase.bind(1, number);
  erase.exec();
  SQLite::Statement remember(database, "INSERT INTO deleted_session(id, number) VALUES(?,?)");
  BindText(remember, 1, id);
  remember.bind(2, number);
  remember.exec();
  return absl::OkStatus();
}

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#include "server/store/postgresql/postgres_roster.h"

#include <spdlog/spdlog.h>

#include <random>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/status/status_macros.h"
#include "server/store/postgresql/postgres_schema.h"

namespace rigcal::server {
namespace {

constexpr std::chrono::milliseconds kSignInterval{1'000};
constexpr std::chrono::milliseconds kSilenceLimit{ServerRoster::kSilenceLimitMs};
// A restart of PostgreSQL ends the connection of a holder that is well and connects again.
constexpr std::chrono::milliseconds kGoneLimit{400};
// Entries of servers that were killed.
constexpr char kDropOld[] = "DELETE FROM server WHERE seen < now() - interval '1 minute'";

constexpr char kColumns[] =
    "s.id, s.host, s.address, s.page, s.version, s.start_utc_ns, "
    "(EXTRACT(EPOCH FROM clock_timestamp() - s.seen) * 1000)::bigint";

std::string NewServerId() {
  std::random_device random;
  return absl::StrFormat("%08x%08x", random(), random());
}

PostgresValue TextValue(std::string_view text) {
  return {.kind = PostgresValue::Kind::kText, .text = StorableText(text)};
}

PostgresValue NumberValue(int64_t number) { return {.number = number}; }

// From column `first` on.
ServerEntry EntryOf(const PostgresResult& rows, int row, int first) {
  const auto text = [&](int column) { return std::string(rows.Bytes(row, first + column)); };
  return {.id = text(0),
          .host = text(1),
          .address = text(2),
          .page = text(3),
          .version = text(4),
          .start_utc_ns = rows.Number(row, first + 5),
          .last_seen_ms = rows.Number(row, first + 6)};
}

}  // namespace

absl::StatusOr<std::unique_ptr<PostgresRoster>> PostgresRoster::Open(
    const PostgresAddress& address, const PostgresStartOptions& start, ServerEntry own) {
  std::unique_ptr<PostgresRoster> roster(new PostgresRoster(address, std::move(own)));
  RIGCAL_RETURN_IF_ERROR(ConnectToPostgres(start, &roster->database_));
  try {
    RIGCAL_RETURN_IF_ERROR(PreparePostgresSchema(roster->database_.connection()));
  } catch (const PostgresError& error) {
    return roster->database_.StatusOf(error, "preparing the database");
  }
  RIGCAL_RETURN_IF_ERROR(roster->Describe(roster->own_));
  roster->life_ = std::thread([alive = roster.get()] { alive->GiveSignsOfLife(); });
  return roster;
}

PostgresRoster::PostgresRoster(const PostgresAddress& address, ServerEntry own)
    : id_(NewServerId()), database_(address), own_(std::move(own)) {
  own_.id = id_;
}

PostgresRoster::~PostgresRoster() {
  {
    const std::lock_guard lock(end_mutex_);
    end_ = true;
  }
  ended_.notify_all();
  if (life_.joinable()) life_.join();
  With("leaving the list of servers", [this](PostgresConnection& connection) {
    connection.Fetch("DELETE FROM server WHERE id=?", {TextValue(id_)});
  }).IgnoreError();
}

template <typename Work>
absl::Status PostgresRoster::With(std::string_view what, const Work& work) {
  const std::lock_guard lock(mutex_);
  if (!database_.connected()) {
    const absl::Status connected = database_.Connect();
    if (!connected.ok()) return absl::UnavailableError(connected.message());
  }
  try {
    work(database_.connection());
    return absl::OkStatus();
  } catch (const PostgresError& error) {
    const absl::Status status = database_.StatusOf(error, what);
    try {
      if (error.connection_lost()) {
        database_.Disconnect();
      } else {
        database_.connection().RollBack();
      }
    } catch (const PostgresError&) {
      database_.Disconnect();
    }
    return status;
  }
}

absl::Status PostgresRoster::Describe(ServerEntry own) {
  {
    const std::lock_guard lock(mutex_);
    own_ = std::move(own);
    own_.id = id_;
  }
  return Enter();
}

absl::Status PostgresRoster::Enter() {
  return With("entering the list of servers", [this](PostgresConnection& connection) {
    // An earlier run of this server, that was killed.
    connection.Send("DELETE FROM server WHERE id<>?1 AND host=?2 AND address=?3",
                    {TextValue(id_), TextValue(own_.host), TextValue(own_.address)});
    connection.Fetch(
        "INSERT INTO server(id, host, address, page, version, start_utc_ns, beat, seen) "
        "VALUES(?1, ?2, ?3, ?4, ?5, ?6, 0, now()) ON CONFLICT(id) DO UPDATE SET host=excluded.host,"
        " address=excluded.address, page=excluded.page, beat=server.beat+1, seen=now()",
        {TextValue(id_), TextValue(own_.host), TextValue(own_.address), TextValue(own_.page),
         TextValue(own_.version), NumberValue(own_.start_utc_ns)});
  });
}

void PostgresRoster::GiveSignsOfLife() {
  std::unique_lock lock(end_mutex_);
  while (!ended_.wait_for(lock, kSignInterval, [this] { return end_; })) {
    lock.unlock();
    // The row may be gone: of a server that stood still for a minute.
    Enter().IgnoreError();
    With("tidying the list of servers", [](PostgresConnection& connection) {
      connection.Run(kDropOld);
    }).IgnoreError();
    if (auto list = ReadList(); list.ok()) {
      const std::lock_guard list_lock(list_mutex_);
      list_ = *std::move(list);
    }
    lock.lock();
  }
}

absl::StatusOr<ServerRoster::Turn> PostgresRoster::LookAtTurn() {
  Turn turn;
  const absl::Status status = With("looking who writes", [&](PostgresConnection& connection) {
    const PostgresResult rows = connection.Fetch(
        absl::StrCat("SELECT w.owner, a.pid IS NOT NULL, coalesce(s.beat, -1), s.id IS NULL, ",
                     kColumns,
                     " FROM writer w LEFT JOIN pg_stat_activity a ON a.pid=w.pid AND "
                     "a.backend_start=w.backend_start LEFT JOIN server s ON s.id=w.server"),
        {});
    if (rows.rows() == 0) return;
    const Clock::time_point now = Clock::now();
    const int64_t owner = rows.Number(0, 0);
    const bool connected = rows.Number(0, 1) != 0;
    const int64_t beat = rows.Number(0, 2);
    if (owner != holder_ || beat != holder_beat_) beat_since_ = now;
    if (owner != holder_ || connected) gone_since_.reset();
    holder_ = owner;
    holder_beat_ = beat;
    if (!connected && !gone_since_) gone_since_ = now;
    // Nobody had it yet.
    if (owner == 0) return;
    if (gone_since_ && now - *gone_since_ >= kGoneLimit) return;
    const bool listed = rows.Number(0, 3) == 0;
    if (connected && now - beat_since_ >= kSilenceLimit &&
        (listed || connection.Run("SELECT server FROM writer WHERE server<>''").size() == 1)) {
      turn.silent_owner = owner;
      return;
    }
    turn.holder = listed ? EntryOf(rows, 0, 4) : ServerEntry();
    turn.holder->active = true;
    if (turn.holder->id == id_) turn.holder.reset();
  });
  if (!status.ok()) return status;
  return turn;
}

std::vector<ServerEntry> PostgresRoster::List() {
  const std::lock_guard lock(list_mutex_);
  return list_;
}

absl::StatusOr<std::vector<ServerEntry>> PostgresRoster::ReadList() {
  std::vector<ServerEntry> servers;
  const absl::Status status =
      With("reading the list of servers", [&](PostgresConnection& connection) {
        const PostgresResult rows =
            connection.Fetch(absl::StrCat("SELECT w.server IS NOT NULL, ", kColumns,
                                          " FROM server s LEFT JOIN writer w ON w.server=s.id "
                                          "ORDER BY 1 DESC, s.start_utc_ns, s.id"),
                             {});
        for (int row = 0; row < rows.rows(); ++row) {
          servers.push_back(EntryOf(rows, row, 1));
          servers.back().active = rows.Number(row, 0) != 0;
        }
      });
  if (!status.ok()) return status;
  return servers;
}

absl::StatusOr<std::vector<SharedDocument>> PostgresRoster::ReadDocuments(int64_t* version) {
  std::vector<SharedDocument> documents;
  const absl::Status status =
      With("reading the files of all servers", [&](PostgresConnection& connection) {
        const PostgresResult rows = connection.Fetch(
            "SELECT name, body, version FROM document WHERE version>? ORDER BY version",
            {NumberValue(*version)});
        for (int row = 0; row < rows.rows(); ++row) {
          SharedDocument document{.name = std::string(rows.Bytes(row, 0))};
          if (!rows.IsNull(row, 1)) document.text = std::string(rows.Bytes(row, 1));
          documents.push_back(std::move(document));
          *version = rows.Number(row, 2);
        }
      });
  if (!status.ok()) return status;
  return documents;
}

absl::Status PostgresRoster::WriteDocuments(const std::vector<SharedDocument>& documents) {
  absl::Status refused;
  RIGCAL_RETURN_IF_ERROR(
      With("writing the files of all servers", [&](PostgresConnection& connection) {
        connection.Run("BEGIN");
        // Held until the commit: a server that takes over reads what this one has written.
        if (connection.Fetch("SELECT 1 FROM writer WHERE server=? FOR SHARE", {TextValue(id_)})
                .rows() == 0) {
          connection.RollBack();
          refused = absl::FailedPreconditionError("another server writes now");
          return;
        }
        for (const SharedDocument& document : documents) {
          PostgresValue body{.kind = PostgresValue::Kind::kBlob, .null = !document.text};
          if (document.text) body.blob = *document.text;
          connection.Send(
              "INSERT INTO document(name, body, version) VALUES(?1, ?2, (SELECT "
              "coalesce(max(version), 0) + 1 FROM document)) ON CONFLICT(name) DO UPDATE SET "
              "body=excluded.body, version=excluded.version",
              {TextValue(document.name), body});
        }
        connection.Flush();
        connection.Run("COMMIT");
      }));
  return refused;
}

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#include "server/store/postgresql/postgres_writer.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstdlib>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/store/postgresql/postgres_schema.h"

namespace rigcal::server {
namespace {

// Attempts of one transaction.
constexpr int kMaxAttempts = 4;
constexpr std::chrono::milliseconds kTakeOverPoll{50};

constexpr char kFence[] = "UPDATE writer SET transaction=? WHERE owner=?";

PostgresValue Number(int64_t number) { return {.number = number}; }

int64_t ToNumber(const std::string& text) { return std::strtoll(text.c_str(), nullptr, 10); }

// Names the process of this connection in the row `writer`.
constexpr char kThisProcess[] =
    "pid=pg_backend_pid(), backend_start=(SELECT backend_start FROM pg_stat_activity WHERE "
    "pid=pg_backend_pid())";

}  // namespace

absl::StatusOr<std::unique_ptr<PostgresWriter>> PostgresWriter::Open(
    const PostgresAddress& address, const PostgresWriterOptions& options) {
  std::unique_ptr<PostgresWriter> writer(new PostgresWriter(address, options));
  RIGCAL_RETURN_IF_ERROR(ConnectToPostgres(options.start, &writer->database_));
  try {
    RIGCAL_RETURN_IF_ERROR(PreparePostgresSchema(writer->connection()));
    writer->server_id_ = ReadPostgresServerId(writer->connection());
    RIGCAL_RETURN_IF_ERROR(writer->TakeOver());
  } catch (const PostgresError& error) {
    return writer->database_.StatusOf(error, "preparing the database");
  }
  return writer;
}

absl::Status PostgresWriter::TakeOver() {
  PostgresConnection& connection = database_.connection();
  if (options_.silent_owner != 0) {
    // What it holds, a transaction that stands still with it, is given up.
    connection.Run(absl::StrCat(
        "SELECT pg_terminate_backend(a.pid) FROM writer w JOIN pg_stat_activity a ON a.pid=w.pid "
        "AND a.backend_start=w.backend_start WHERE w.owner=",
        options_.silent_owner));
  }
  const Clock::time_point limit = Clock::now() + options_.takeover_limit;
  while (true) {
    const auto others = connection.Run(
        "SELECT a.pid, coalesce(host(a.client_addr), 'this PC'), a.backend_start FROM writer w "
        "JOIN "
        "pg_stat_activity a ON a.pid=w.pid AND a.backend_start=w.backend_start");
    if (others.empty()) break;
    if (Clock::now() > limit) {
      // A server that may wait for its turn waits again.
      return absl::Status(
          options_.server.empty() ? absl::StatusCode::kFailedPrecondition
                                  : absl::StatusCode::kAborted,
          absl::StrCat(connection.place(), " is in use by another rigcal-server, connected from ",
                       others[0][1], " since ", others[0][2], " (process ", others[0][0],
                       " of PostgreSQL); stop that one, or give this one another --store"));
    }
    // One that was killed: its process at the database ends in a moment.
    std::this_thread::sleep_for(kTakeOverPoll);
  }
  // Of several that have seen the same, the first one is it.
  const PostgresResult taken = connection.Fetch(
      absl::StrCat("UPDATE writer SET owner=owner+1, server=?1, ", kThisProcess,
                   " WHERE NOT EXISTS(SELECT 1 FROM pg_stat_activity a WHERE a.pid=writer.pid AND "
                   "a.backend_start=writer.backend_start) RETURNING owner, transaction"),
      {{.kind = PostgresValue::Kind::kText,
        .null = options_.server.empty(),
        .text = options_.server}});
  if (taken.rows() == 0 && !connection.Run("SELECT 1 FROM writer").empty()) {
    return absl::AbortedError(
        absl::StrCat(connection.place(), " was taken by another rigcal-server at this moment"));
  }
  if (taken.rows() != 1) {
    return absl::DataLossError(absl::StrCat(
        connection.place(), " has lost its row of table writer; restore a backup of it"));
  }
  owner_ = taken.Number(0, 0);
  transaction_ = taken.Number(0, 1);
  return absl::OkStatus();
}

absl::Status PostgresWriter::Transact(std::string_view what, const Work& work,
                                      const std::function<void()>& on_rollback) {
  const std::lock_guard lock(mutex_);
  for (int attempt = 1;; ++attempt) {
    RIGCAL_RETURN_IF_ERROR(EnsureConnected());
    bool committing = false;
    try {
      const absl::Status status = TryTransact(work, &committing);
      if (!status.ok() && on_rollback) on_rollback();
      return status;
    } catch (const PostgresError& error) {
      if (on_rollback) on_rollback();
      const absl::Status status = database_.StatusOf(error, what);
      if (error.sqlstate() == PostgresError::kTakenOver) return Fail(status);
      if (error.connection_lost()) {
        spdlog::warn("{}", std::string(status.message()));
        database_.Disconnect();
        Fail(status).IgnoreError();
      }
      if (committing && error.connection_lost()) {
        const int64_t before = transaction_;
        const absl::Status connected = ConnectWithin(options_.settle_limit);
        if (!connected.ok()) {
          return absl::Status(connected.code(),
                              absl::StrCat(std::string(what),
                                           ": the connection was lost during the commit, and "
                                           "nobody knows yet whether it took place: ",
                                           std::string(connected.message()),
                                           "; look at what is there before you do it again"));
        }
        if (transaction_ != before) return absl::OkStatus();
      } else if (!error.connection_lost() && !error.repeatable()) {
        return status;
      }
      if (attempt >= kMaxAttempts) return status;
    } catch (const std::exception& error) {
      if (on_rollback) on_rollback();
      database_.Disconnect();
      return absl::InternalError(absl::StrCat(std::string(what), ": ", error.what()));
    }
  }
}

absl::Status PostgresWriter::TryTransact(const Work& work, bool* committing) {
  PostgresConnection& connection = database_.connection();
  try {
    connection.Send("BEGIN", {});
    connection.Send(kFence, {Number(transaction_ + 1), Number(owner_)}, 1);
    const absl::Status status = work(database_);
    if (!status.ok()) {
      connection.RollBack();
      return status;
    }
    // The commit is sent when all before it has succeeded.
    connection.Flush();
    *committing = true;
    connection.Fetch("COMMIT", {});
  } catch (const PostgresError& error) {
    if (!error.connection_lost()) connection.RollBack();
    throw;
  }
  ++transaction_;
  return absl::OkStatus();
}

absl::Status PostgresWriter::EnsureConnected() {
  {
    const std::lock_guard lock(problem_mutex_);
    if (absl::IsFailedPrecondition(problem_)) return problem_;
    if (!database_.connected() && Clock::now() < next_attempt_) return problem_;
  }
  if (database_.connected()) return absl::OkStatus();
  absl::Status resumed = Resume();
  if (resumed.ok()) {
    spdlog::info("connected again with {}", database_.connection().place());
    pause_ = std::chrono::milliseconds(0);
    next_attempt_ = {};
    const std::lock_guard lock(problem_mutex_);
    problem_ = absl::OkStatus();
    return problem_;
  }
  database_.Disconnect();
  pause_ = std::clamp(2 * pause_, options_.first_pause, options_.longest_pause);
  next_attempt_ = Clock::now() + pause_;
  return Fail(std::move(resumed));
}

absl::Status PostgresWriter::Resume() {
  absl::Status connected = database_.Connect();
  // A refusal now is one of a server that starts, or changes its role: it may pass.
  if (!connected.ok()) return absl::UnavailableError(connected.message());
  try {
    PostgresConnection& connection = database_.connection();
    if (const absl::Status usable = CheckPostgresServer(connection, options_.start); !usable.ok()) {
      return absl::UnavailableError(usable.message());
    }
    // Waits for a transaction of the lost connection that is about to end. The count is of what was
    // committed.
    const auto rows = connection.Run(absl::StrCat(
        "UPDATE writer SET ", kThisProcess, " WHERE owner=", owner_, " RETURNING transaction"));
    if (rows.size() != 1) {
      throw PostgresError(PostgresError::kTakenOver,
                          "this server is not the one that writes any more");
    }
    transaction_ = ToNumber(rows[0][0]);
    return absl::OkStatus();
  } catch (const PostgresError& error) {
    return database_.StatusOf(error, "connecting again");
  }
}

absl::Status PostgresWriter::ConnectWithin(std::chrono::milliseconds limit) {
  const Clock::time_point end = Clock::now() + limit;
  while (true) {
    absl::Status connected = EnsureConnected();
    if (connected.ok() || absl::IsFailedPrecondition(connected) || Clock::now() >= end) {
      return connected;
    }
    std::this_thread::sleep_until(std::min(end, next_attempt_));
  }
}

absl::Status PostgresWriter::Fail(absl::Status status) {
  const std::lock_guard lock(problem_mutex_);
  problem_ = std::move(status);
  return problem_;
}

bool PostgresWriter::replaced() const {
  const std::lock_guard lock(problem_mutex_);
  return absl::IsFailedPrecondition(problem_);
}

std::string PostgresWriter::problem() const {
  const std::lock_guard lock(problem_mutex_);
  return std::string(problem_.message());
}

void PostgresWriter::Recover() {
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (lock.owns_lock()) EnsureConnected().IgnoreError();
}

}  // namespace rigcal::server

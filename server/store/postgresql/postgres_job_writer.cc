// SPDX-License-Identifier: Apache-2.0
#include "server/store/postgresql/postgres_job_writer.h"

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/store/postgresql/postgres_schema.h"

namespace rigcal::server {
namespace {

constexpr int kMaxRepeats = 4;  // of a transaction that met another one
// Between attempts to connect again: a database that is gone answers at once or after seconds.
constexpr std::chrono::milliseconds kConnectPause{500};

}  // namespace

absl::StatusOr<std::unique_ptr<PostgresJobWriter>> PostgresJobWriter::Open(
    const PostgresAddress& address) {
  std::unique_ptr<PostgresJobWriter> writer(new PostgresJobWriter(address));
  RIGCAL_RETURN_IF_ERROR(writer->Connect());
  return writer;
}

absl::Status PostgresJobWriter::Connect() {
  RIGCAL_RETURN_IF_ERROR(database_.Connect());
  try {
    absl::Status usable = CheckPostgresSchema(database_.connection());
    if (!usable.ok()) {
      return absl::Status(usable.code(),
                          absl::StrCat("rigcal-worker takes no calibrations: ", usable.message(),
                                       ". Server and workers are of one release"));
    }
    server_id_ = ReadPostgresServerId(database_.connection());
    return absl::OkStatus();
  } catch (const PostgresError& error) {
    return database_.StatusOf(error, "reading the schema");
  }
}

absl::Status PostgresJobWriter::EnsureConnected() {
  if (database_.connected()) return absl::OkStatus();
  if (Clock::now() < next_attempt_) {
    const std::lock_guard lock(problem_mutex_);
    return problem_;
  }
  next_attempt_ = Clock::now() + kConnectPause;
  absl::Status connected = Connect();
  if (connected.ok()) return Note(connected);
  database_.Disconnect();
  // A refusal may be of a database that starts, or is restored: it may pass.
  return Note(absl::UnavailableError(connected.message()));
}

absl::Status PostgresJobWriter::Transact(std::string_view what, const Work& work,
                                         const std::function<void()>& on_rollback) {
  const std::lock_guard lock(mutex_);
  for (int attempt = 1;; ++attempt) {
    RIGCAL_RETURN_IF_ERROR(EnsureConnected());
    try {
      const absl::Status status = TryTransact(work);
      if (!status.ok() && on_rollback) on_rollback();
      return status;
    } catch (const PostgresError& error) {
      if (on_rollback) on_rollback();
      const absl::Status status = database_.StatusOf(error, what);
      if (error.connection_lost()) {
        database_.Disconnect();
        return Note(status);
      }
      if (!error.repeatable() || attempt >= kMaxRepeats) return status;
    } catch (const std::exception& error) {
      if (on_rollback) on_rollback();
      database_.Disconnect();
      return absl::InternalError(absl::StrCat(std::string(what), ": ", error.what()));
    }
  }
}

absl::Status PostgresJobWriter::TryTransact(const Work& work) {
  PostgresConnection& connection = database_.connection();
  try {
    connection.Send("BEGIN", {});
    const absl::Status status = work(database_);
    if (!status.ok()) {
      connection.RollBack();
      return status;
    }
    connection.Flush();
    connection.Fetch("COMMIT", {});
  } catch (const PostgresError& error) {
    if (!error.connection_lost()) connection.RollBack();
    throw;
  }
  return absl::OkStatus();
}

absl::Status PostgresJobWriter::Note(absl::Status status) {
  const std::lock_guard lock(problem_mutex_);
  problem_ = std::move(status);
  return problem_;
}

std::string PostgresJobWriter::problem() const {
  const std::lock_guard lock(problem_mutex_);
  return std::string(problem_.message());
}

}  // namespace rigcal::server

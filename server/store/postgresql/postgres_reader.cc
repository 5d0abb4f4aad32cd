// SPDX-License-Identifier: Apache-2.0
#include "server/store/postgresql/postgres_reader.h"

#include <spdlog/spdlog.h>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"

namespace rigcal::server {
namespace {

absl::Status ReadOnce(PostgresDatabase& database, const SqlWriter::Work& work) {
  PostgresConnection& connection = database.connection();
  try {
    connection.Send("BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY", {});
    absl::Status status = work(database);
    connection.Fetch("COMMIT", {});
    return status;
  } catch (const PostgresError& error) {
    if (!error.connection_lost()) connection.RollBack();
    throw;
  }
}

}  // namespace

absl::StatusOr<std::unique_ptr<PostgresReader>> PostgresReader::Open(
    const PostgresAddress& address) {
  std::unique_ptr<PostgresReader> reader(new PostgresReader(address));
  RIGCAL_RETURN_IF_ERROR(reader->database_.Connect());
  return reader;
}

absl::Status PostgresReader::ReadWith(std::string_view what, const SqlWriter::Work& work) {
  const std::lock_guard lock(mutex_);
  for (const bool last_attempt : {false, true}) {
    if (!database_.connected()) {
      const absl::Status connected = database_.Connect();
      if (!connected.ok()) return absl::UnavailableError(connected.message());
    }
    try {
      return ReadOnce(database_, work);
    } catch (const PostgresError& error) {
      const absl::Status status = database_.StatusOf(error, what);
      if (!error.connection_lost()) return NoteFailure(status);
      database_.Disconnect();
      if (last_attempt) return status;
    } catch (const std::exception& error) {
      database_.Disconnect();
      return absl::InternalError(absl::StrCat(std::string(what), ": ", error.what()));
    }
  }
  return absl::InternalError("unreachable");
}

absl::Status PostgresReader::NoteFailure(absl::Status status) {
  if (!absl::IsDataLoss(status)) return status;
  const std::lock_guard lock(problem_mutex_);
  if (problem_.empty()) {
    problem_ = absl::StrCat("the store cannot be read: ", std::string(status.message()));
    spdlog::error("{}", problem_);
  }
  return status;
}

std::string PostgresReader::problem() const {
  const std::lock_guard lock(problem_mutex_);
  return problem_;
}

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#include "server/store/postgresql/postgres_error.h"

#include "absl/strings/str_cat.h"

namespace rigcal::server {
namespace {

bool IsOfClass(const std::string& sqlstate, std::string_view code) {
  return sqlstate.starts_with(code);
}

}  // namespace

bool PostgresError::connection_lost() const {
  // 57P01 to 57P05: the server ends, has crashed, starts, the database was dropped, idle too long.
  // 25P03: a transaction that was idle too long. 25006: the server has become a standby.
  return IsOfClass(sqlstate_, "08") || IsOfClass(sqlstate_, "57P") || sqlstate_ == "25P03" ||
         sqlstate_ == "25006";
}

absl::Status StatusFromPostgres(const PostgresError& error, std::string_view what,
                                std::string_view place) {
  const std::string& code = error.sqlstate();
  const std::string reason = absl::StrCat(std::string(what), " in ", std::string(place), ": ",
                                          error.what(), " (SQLSTATE ", code, ")");
  if (error.connection_lost() || error.repeatable()) {
    return absl::UnavailableError(absl::StrCat(reason, "; try again later"));
  }
  if (code == PostgresError::kTakenOver) {
    return absl::FailedPreconditionError(absl::StrCat(
        reason,
        "; another rigcal-server has taken this database over: this one stores nothing until its "
        "turn comes again"));
  }
  if (code == "53100") {
    return absl::ResourceExhaustedError(
        absl::StrCat(reason, "; the disk of the database is full: free space or delete sessions"));
  }
  if (IsOfClass(code, "53")) return absl::UnavailableError(reason);
  if (IsOfClass(code, "XX00") && code != "XX000") {
    return absl::DataLossError(
        absl::StrCat(reason, "; the database is damaged: restore a backup of it"));
  }
  if (code == "42501") {
    return absl::FailedPreconditionError(absl::StrCat(
        reason, "; make the user of the server the owner of the database and its tables"));
  }
  // The statements of a session are not those that were prepared in it.
  if (code == "42P05" || code == "26000") {
    return absl::FailedPreconditionError(absl::StrCat(reason, "; ", kPoolerAdvice));
  }
  return absl::InternalError(reason);
}

}  // namespace rigcal::server

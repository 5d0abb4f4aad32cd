// SPDX-License-Identifier: Apache-2.0
#include "server/store/sql/replica_writer.h"

#include <algorithm>
#include <iterator>
#include <memory>
#include <optional>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "common/status/status_macros.h"
#include "server/store/sql/replica_reader.h"
#include "server/store/sql/session_table.h"
#include "server/store/sql/stored_tables.h"

namespace rigcal::server {
namespace {

// Other rows refer to rows of these: they are changed where they are, and deleted last.
constexpr std::string_view kReferredTo[] = {"session", "session_camera", "stream", "calibration"};

bool IsReferredTo(std::string_view table) {
  return std::ranges::find(kReferredTo, table) != std::end(kReferredTo);
}

std::string Upsert(const StoredTable& table) {
  std::vector<std::string> changes;
  for (const absl::string_view column : absl::StrSplit(table.Columns(), ',')) {
    changes.push_back(absl::StrCat(column, "=excluded.", column));
  }
  return absl::StrCat(table.Insertion(), " ON CONFLICT(", table.key, ") DO UPDATE SET ",
                      absl::StrJoin(changes, ","));
}

absl::Status CheckShape(const StoredTable& table, const ReplicaRow& row) {
  if (static_cast<int>(row.numbers.size()) == table.number_count() &&
      static_cast<int>(row.values.size()) == table.text_count() + table.blob_count()) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      absl::StrCat("the primary sent a row of table ", table.name, " with ", row.numbers.size(),
                   " numbers and ", row.values.size(),
                   " texts, which this server's table does not have: both "
                   "must be of the same release"));
}

void Insert(const StoredTable& table, const ReplicaRow& row, SqlStatement& insert) {
  const StatementScope scope(insert);
  int column = 0;
  for (const int64_t number : row.numbers) {
    if ((row.without_value >> static_cast<unsigned>(column) & 1u) != 0) {
      insert.Bind(column + 1, std::optional<uint32_t>());
    } else {
      insert.Bind(column + 1, number);
    }
    ++column;
  }
  for (size_t i = 0; i < row.values.size(); ++i, ++column) {
    if (static_cast<int>(i) < table.text_count()) {
      insert.Bind(column + 1, std::string_view(row.values[i]));
    } else {
      insert.Bind(column + 1, Blob{row.values[i]});
    }
  }
  insert.Run();
}

void Clear(SqlDatabase& database, const StoredTable& table, const std::string& id) {
  const std::string condition = table.of_record;
  if (condition.empty()) {
    SqlStatement(database, absl::StrCat("DELETE FROM ", table.name)).Run();
  } else {
    Query(database, absl::StrCat("DELETE FROM ", table.name, " WHERE ", condition), id).Run();
  }
}

class RecordWriter {
 public:
  RecordWriter(SqlDatabase& database, const std::string& id) : database_(database), id_(id) {}

  absl::Status Add(const ReplicaRows& rows) {
    const StoredTable* const table = FindStoredTable(rows.table);
    if (table == nullptr) {
      return absl::InvalidArgumentError(
          absl::StrCat("the primary sent rows of a table ", rows.table,
                       " that this server does not have: both must be of the same release"));
    }
    for (const ReplicaRow& row : rows.rows) RIGCAL_RETURN_IF_ERROR(CheckShape(*table, row));
    if (IsReferredTo(rows.table)) {
      SqlStatement upsert(database_, Upsert(*table));
      std::set<int64_t>& kept = rows.table == "stream" ? streams_ : cameras_;
      for (const ReplicaRow& row : rows.rows) {
        Insert(*table, row, upsert);
        if (rows.table == "stream" || rows.table == "session_camera") kept.insert(row.numbers[0]);
      }
      return absl::OkStatus();
    }
    const bool grows = table->owner == TableOwner::kStreams;
    if (!grows && !rows.continues) Clear(database_, *table, id_);
    if (rows.rows.empty()) return absl::OkStatus();
    SqlStatement insert(database_, table->Insertion() + (grows ? " ON CONFLICT DO NOTHING" : ""));
    for (const ReplicaRow& row : rows.rows) Insert(*table, row, insert);
    return absl::OkStatus();
  }

  // What the primary's session does not have any more.
  void DeleteOthers() {
    for (const char* const name : {"stream", "session_camera"}) {
      const std::set<int64_t>& kept = name == std::string_view("stream") ? streams_ : cameras_;
      std::vector<int64_t> others;
      {
        SqlStatement row = Query(
            database_,
            absl::StrCat("SELECT id FROM ", name, " WHERE ", FindStoredTable(name)->of_record),
            id_);
        while (row.Step()) {
          if (!kept.contains(row.Int64(0))) others.push_back(row.Int64(0));
        }
      }
      for (const int64_t number : others) {
        Query(database_, absl::StrCat("DELETE FROM ", name, " WHERE id=?"), number).Run();
      }
    }
  }

 private:
  SqlDatabase& database_;
  const std::string& id_;
  std::set<int64_t> streams_;
  std::set<int64_t> cameras_;
};

absl::Status Compare(const std::vector<ReplicaDigest>& primary,
                     const std::vector<ReplicaDigest>& own) {
  for (const ReplicaDigest& digest : primary) {
    const auto found = std::ranges::find(own, digest.table, &ReplicaDigest::table);
    if (found != own.end() && *found == digest) continue;
    return absl::DataLossError(
        absl::StrCat("table ", digest.table, " differs from the primary's: ", digest.row_count,
                     " rows with digest ", absl::Hex(digest.digest), " there, ",
                     found == own.end() ? uint64_t{0} : found->row_count, " rows with digest ",
                     absl::Hex(found == own.end() ? 0u : found->digest), " here"));
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status WriteRecord(
    SqlDatabase& database, ReplicaKind kind, const std::string& id,
    const std::function<absl::StatusOr<std::vector<ReplicaDigest>>(const ReplicaTarget::TakeRows&)>&
        read) {
  RecordWriter writer(database, id);
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<ReplicaDigest> digests,
                          read([&](const std::vector<ReplicaRows>& part) {
                            for (const ReplicaRows& rows : part) {
                              RIGCAL_RETURN_IF_ERROR(writer.Add(rows));
                            }
                            return absl::OkStatus();
                          }));
  if (kind == ReplicaKind::kSession) writer.DeleteOthers();
  return Compare(digests, DigestReplica(database, kind, id));
}

void EraseRecord(SqlDatabase& database, ReplicaKind kind, const std::string& id) {
  if (kind == ReplicaKind::kSession) {
    EraseStreamRows(database, id);
    Query(database, "DELETE FROM session WHERE id=?", id).Run();
  } else if (kind == ReplicaKind::kCalibration) {
    Query(database, "DELETE FROM calibration WHERE id=?", id).Run();
  }
}

}  // namespace rigcal::server

// SPDX-License-Identifier: Apache-2.0
#include "server/store/sql/table_copy.h"

#include <memory>
#include <optional>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "server/store/sql/stored_tables.h"

namespace rigcal::server {
namespace {

// Read at once: a batch is a few megabytes at most.
constexpr int kBatchesAtOnce = 16;

// Goes through the rows of one table.
class TableReader {
 public:
  // `to`: where each row is added; null: nowhere.
  TableReader(const StoredTable& table, SqlDatabase& from, SqlDatabase* to)
      : table_(table), from_(from), copied_{.name = table.name} {
    if (to != nullptr) insert_ = std::make_unique<SqlStatement>(*to, table.Insertion());
  }

  CopiedTable Run() {
    const std::string select = absl::StrCat("SELECT ", table_.Columns(), " FROM ", table_.name);
    if (std::string_view(table_.name) != "batch") {
      SqlStatement row(from_, absl::StrCat(select, " ORDER BY ", table_.key));
      while (row.Step()) Take(row);
      return copied_;
    }
    // A large table; a database may read all that it is asked for at once.
    int64_t after = -1;
    for (bool more = true; more;) {
      SqlStatement row = Query(from_, absl::StrCat(select, " WHERE id>? ORDER BY id LIMIT ?"),
                               after, kBatchesAtOnce);
      for (more = false; row.Step(); more = true) {
        after = row.Int64(0);
        Take(row);
      }
    }
    return copied_;
  }

 private:
  void Take(SqlStatement& row) {
    ++copied_.rows;
    AddToDigest(table_, row, &copied_.digest);
    if (insert_ == nullptr) return;
    int column = 0;
    for (; column < table_.number_count(); ++column) {
      if (row.IsNull(column)) {
        insert_->Bind(column + 1, std::optional<uint32_t>());
      } else {
        insert_->Bind(column + 1, row.Int64(column));
      }
    }
    for (; column < table_.column_count(); ++column) {
      if (column < table_.number_count() + table_.text_count()) {
        insert_->Bind(column + 1, row.Bytes(column));
      } else {
        insert_->Bind(column + 1, Blob{row.Bytes(column)});
      }
    }
    insert_->Run();
    insert_->Reset();
  }

  const StoredTable& table_;
  SqlDatabase& from_;
  std::unique_ptr<SqlStatement> insert_;
  CopiedTable copied_;
};

}  // namespace

absl::Status CheckTablesAreEmpty(SqlDatabase& database) {
  for (const char* table : {"session", "deleted_session", "calibration", "activation", "counter"}) {
    SqlStatement row(database, absl::StrCat("SELECT 1 FROM ", table, " LIMIT 1"));
    if (!row.Step()) continue;
    return absl::FailedPreconditionError(
        absl::StrCat("the destination is not empty: its table ", table,
                     " has rows; name a new folder or an empty database"));
  }
  return absl::OkStatus();
}

std::vector<CopiedTable> CopyTables(SqlDatabase& from, SqlDatabase& to) {
  SqlStatement(to, "DELETE FROM identity").Run();
  std::vector<CopiedTable> copied;
  for (const StoredTable& table : StoredTables())
    copied.push_back(TableReader(table, from, &to).Run());
  return copied;
}

std::vector<CopiedTable> DigestTables(SqlDatabase& database) {
  std::vector<CopiedTable> read;
  for (const StoredTable& table : StoredTables())
    read.push_back(TableReader(table, database, nullptr).Run());
  return read;
}

absl::Status CompareCopies(const std::vector<CopiedTable>& source,
                           const std::vector<CopiedTable>& copy) {
  for (size_t i = 0; i < source.size(); ++i) {
    if (source[i].rows == copy[i].rows && source[i].digest == copy[i].digest) continue;
    return absl::DataLossError(absl::StrCat(
        "the copy differs from its source in table ", source[i].name, ": ", source[i].rows,
        " rows with digest ", absl::Hex(source[i].digest), " there, ", copy[i].rows,
        " rows with digest ", absl::Hex(copy[i].digest), " here; do not use the copy"));
  }
  return absl::OkStatus();
}

}  // namespace rigcal::server

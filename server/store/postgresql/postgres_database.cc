// SPDX-License-Identifier: Apache-2.0
#include "server/store/postgresql/postgres_database.h"

#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"

namespace rigcal::server {
namespace {

class PostgresStatement final : public SqlStatementDriver {
 public:
  PostgresStatement(const PostgresDatabase* database, std::string sql)
      : database_(*database), sql_(std::move(sql)) {}

  void BindNumber(int index, int64_t value) override {
    At(index) = {.kind = PostgresValue::Kind::kNumber, .number = value};
  }
  void BindText(int index, std::string_view text) override {
    At(index) = {.kind = PostgresValue::Kind::kText, .text = StorableText(text)};
  }
  void BindBlob(int index, std::string_view bytes) override {
    At(index) = {.kind = PostgresValue::Kind::kBlob, .blob = bytes};
  }
  void BindNull(int index) override {
    At(index) = {.kind = PostgresValue::Kind::kNumber, .null = true};
  }
  void Run() override { database_.connection().Send(sql_, values_); }
  int64_t RunAndCount() override {
    return database_.connection().Fetch(sql_, values_).changed_rows();
  }
  bool Step() override {
    if (!stepping_) {
      result_ = database_.connection().Fetch(sql_, values_);
      stepping_ = true;
      row_ = -1;
    }
    return ++row_ < result_.rows();
  }
  void Reset() override {
    stepping_ = false;
    result_ = {};
  }
  bool IsNull(int column) override { return result_.IsNull(row_, column); }
  int64_t Number(int column) override { return result_.Number(row_, column); }
  std::string_view Bytes(int column) override { return result_.Bytes(row_, column); }

 private:
  PostgresValue& At(int index) {
    const auto at = static_cast<size_t>(index - 1);
    if (values_.size() <= at) values_.resize(at + 1);
    return values_[at];
  }

  const PostgresDatabase& database_;
  const std::string sql_;
  std::vector<PostgresValue> values_;
  PostgresResult result_;
  bool stepping_ = false;
  int row_ = -1;
};

}  // namespace

absl::Status PostgresDatabase::Connect() {
  connection_.reset();
  RIGCAL_ASSIGN_OR_RETURN(connection_, PostgresConnection::Open(address_));
  return absl::OkStatus();
}

PostgresConnection& PostgresDatabase::connection() const {
  if (connection_ == nullptr) {
    throw PostgresError(PostgresError::kConnectionLost, "there is no connection");
  }
  return *connection_;
}

std::unique_ptr<SqlStatementDriver> PostgresDatabase::Prepare(const std::string& sql) {
  return std::make_unique<PostgresStatement>(this, sql);
}

std::string PostgresDatabase::NowMs() const {
  // Not now(): that one stands still within a transaction.
  return "CAST(floor(extract(epoch FROM clock_timestamp())*1000) AS BIGINT)";
}

absl::Status PostgresDatabase::StatusOf(const std::exception& error, std::string_view what) const {
  if (const auto* of_postgres = dynamic_cast<const PostgresError*>(&error)) {
    return StatusFromPostgres(*of_postgres, what,
                              connection_ == nullptr ? address_.text() : connection_->place());
  }
  return absl::InternalError(absl::StrCat(std::string(what), ": ", error.what()));
}

}  // namespace rigcal::server

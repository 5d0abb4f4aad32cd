// SPDX-License-Identifier: Apache-2.0
#include "server/store/postgresql/postgres_connection.h"

#include <algorithm>
#include <bit>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"

namespace rigcal::server {
namespace {

// Types by their numbers in pg_type.
constexpr Oid kBool = 16;
constexpr Oid kBytea = 17;
constexpr Oid kInt8 = 20;
constexpr Oid kInt2 = 21;
constexpr Oid kInt4 = 23;
constexpr Oid kText = 25;

// Beyond this many, statements are parsed each time.
constexpr size_t kMaxPrepared = 400;
// Results of statements that nobody waits for are read at least this often.
constexpr size_t kMaxUnread = 512;

template <typename Number>
Number Swapped(Number value) {
  static_assert(std::endian::native == std::endian::little);
  char bytes[sizeof(value)];
  std::memcpy(bytes, &value, sizeof(value));
  std::reverse(bytes, bytes + sizeof(value));
  std::memcpy(&value, bytes, sizeof(value));
  return value;
}

template <typename Number>
int64_t ReadNumber(const char* bytes) {
  Number value;
  std::memcpy(&value, bytes, sizeof(value));
  return Swapped(value);
}

Oid TypeOf(const PostgresValue& value) {
  switch (value.kind) {
    case PostgresValue::Kind::kText:
      return kText;
    case PostgresValue::Kind::kBlob:
      return kBytea;
    case PostgresValue::Kind::kNumber:
      break;
  }
  return kInt8;
}

// Parameters as libpq takes them.
class BoundValues {
 public:
  explicit BoundValues(absl::Span<const PostgresValue> values)
      : numbers_(values.size()), formats_(values.size(), 1) {
    for (size_t i = 0; i < values.size(); ++i) {
      const PostgresValue& value = values[i];
      types_.push_back(TypeOf(value));
      std::string_view bytes;
      if (value.kind == PostgresValue::Kind::kNumber) {
        numbers_[i] = Swapped(value.number);
        bytes = {reinterpret_cast<const char*>(&numbers_[i]), sizeof(int64_t)};
      } else if (value.kind == PostgresValue::Kind::kText) {
        bytes = value.text;
      } else {
        bytes = value.blob;
      }
      // A null pointer would be NULL instead of an empty value.
      pointers_.push_back(value.null ? nullptr : (bytes.empty() ? "" : bytes.data()));
      lengths_.push_back(static_cast<int>(bytes.size()));
    }
  }
  int count() const { return static_cast<int>(types_.size()); }
  const Oid* types() const { return types_.data(); }
  const char* const* pointers() const { return pointers_.data(); }
  const int* lengths() const { return lengths_.data(); }
  const int* formats() const { return formats_.data(); }

 private:
  std::vector<int64_t> numbers_;
  std::vector<Oid> types_;
  std::vector<const char*> pointers_;
  std::vector<int> lengths_;
  std::vector<int> formats_;
};

// libpq's messages have several lines.
std::string OneLine(const char* message) {
  std::string line = message == nullptr ? "" : message;
  std::replace_if(
      line.begin(), line.end(), [](char c) { return c == '\n' || c == '\t'; }, ' ');
  absl::RemoveExtraAsciiWhitespace(&line);
  return line;
}

// Which of several hosts, without the password.
std::string PlaceOf(PGconn* connection, const PostgresAddress& address) {
  const char* host = PQhost(connection);
  const char* user = PQuser(connection);
  const char* port = PQport(connection);
  const char* name = PQdb(connection);
  if (host == nullptr || name == nullptr || *name == '\0') return address.text();
  return absl::StrCat("postgresql://", user == nullptr ? "" : user, "@", host, ":",
                      port == nullptr ? "" : port, "/", name);
}

absl::Status WhyNotOpen(PGconn* connection, const PostgresAddress& address) {
  const std::string why =
      absl::StrCat("cannot open ", address.text(), ": ", OneLine(PQerrorMessage(connection)));
  if (PQconnectionNeedsPassword(connection) != 0) {
    return absl::FailedPreconditionError(absl::StrCat(
        why,
        "; no password was given: put it into the file ~/.pgpass of the server's user, into "
        "PGPASSWORD, or into the address"));
  }
  if (PQconnectionUsedPassword(connection) != 0) {
    return absl::FailedPreconditionError(absl::StrCat(
        why,
        "; check the user, its password (in the address, PGPASSWORD or ~/.pgpass) and the name "
        "of the database"));
  }
  return absl::UnavailableError(absl::StrCat(
      why,
      "; check that PostgreSQL runs there, host and port, and that its pg_hba.conf lets this "
      "PC and this user in"));
}

// Never weaker than on the server's disk; what the database's owner has set beyond that stays. A
// connection whose other end is gone ends by itself, and with it what it holds locked.
constexpr char kSessionSettings[] =
    "SELECT set_config('synchronous_commit', CASE WHEN current_setting('synchronous_commit') IN "
    "('off', 'local') THEN 'on' ELSE current_setting('synchronous_commit') END, false), "
    "set_config('idle_in_transaction_session_timeout', '60s', false), "
    "set_config('tcp_keepalives_idle', '10', false), "
    "set_config('tcp_keepalives_interval', '3', false), "
    "set_config('tcp_keepalives_count', '3', false)";

}  // namespace

int64_t PostgresResult::Number(int row, int column) const {
  const char* bytes = PQgetvalue(result_.get(), row, column);
  if (IsNull(row, column)) return 0;
  switch (PQftype(result_.get(), column)) {
    case kInt8:
      return ReadNumber<int64_t>(bytes);
    case kInt4:
      return ReadNumber<int32_t>(bytes);
    case kInt2:
      return ReadNumber<int16_t>(bytes);
    case kBool:
      return *bytes != 0;
    default:
      throw PostgresError("XX000", absl::StrCat("column ", column, " is no number"));
  }
}

std::string_view PostgresResult::Bytes(int row, int column) const {
  return {PQgetvalue(result_.get(), row, column),
          static_cast<size_t>(PQgetlength(result_.get(), row, column))};
}

int64_t PostgresResult::changed_rows() const {
  return std::strtoll(PQcmdTuples(result_.get()), nullptr, 10);
}

absl::StatusOr<std::unique_ptr<PostgresConnection>> PostgresConnection::Open(
    const PostgresAddress& address) {
  std::vector<const char*> names, values;
  for (const auto& [name, value] : address.options()) {
    names.push_back(name.c_str());
    values.push_back(value.c_str());
  }
  names.push_back(nullptr);
  values.push_back(nullptr);
  std::unique_ptr<PGconn, Finish> connection(PQconnectdbParams(names.data(), values.data(), 0));
  if (connection == nullptr) return absl::ResourceExhaustedError("no memory for a connection");
  if (PQstatus(connection.get()) != CONNECTION_OK) return WhyNotOpen(connection.get(), address);
  std::string place = PlaceOf(connection.get(), address);
  // Notices of the server are no news.
  PQsetNoticeProcessor(
      connection.get(), [](void*, const char*) {}, nullptr);
  std::unique_ptr<PostgresConnection> opened(
      new PostgresConnection(connection.release(), std::move(place)));
  try {
    opened->Run(kSessionSettings);
  } catch (const PostgresError& error) {
    return StatusFromPostgres(error, "setting the session", opened->place());
  }
  return opened;
}

void PostgresConnection::ThrowLost() const {
  std::string why = OneLine(PQerrorMessage(connection_.get()));
  if (why.empty()) why = "the connection is lost";
  throw PostgresError(PostgresError::kConnectionLost, why);
}

void PostgresConnection::Require(int accepted) const {
  if (accepted == 1) return;
  if (!alive()) ThrowLost();
  throw PostgresError("XX000", OneLine(PQerrorMessage(connection_.get())));
}

std::string PostgresConnection::Prepare(const std::string& sql,
                                        absl::Span<const PostgresValue> values) {
  if (const auto found = prepared_.find(sql); found != prepared_.end()) return found->second;
  if (prepared_.size() >= kMaxPrepared) return "";
  std::string name = absl::StrCat("rigcal_", next_name_++);
  const BoundValues bound(values);
  Require(PQsendPrepare(connection_.get(), name.c_str(), NumberedParameters(sql).c_str(),
                        bound.count(), bound.types()));
  sent_.push_back(-1);
  prepared_.emplace(sql, name);
  return name;
}

void PostgresConnection::Send(const std::string& sql, absl::Span<const PostgresValue> values,
                              int required_rows) {
  if (!alive()) ThrowLost();
  if (PQpipelineStatus(connection_.get()) == PQ_PIPELINE_OFF) {
    Require(PQenterPipelineMode(connection_.get()));
  }
  if (sent_.size() >= kMaxUnread) Flush();
  const std::string name = Prepare(sql, values);
  const BoundValues bound(values);
  if (name.empty()) {
    Require(PQsendQueryParams(connection_.get(), NumberedParameters(sql).c_str(), bound.count(),
                              bound.types(), bound.pointers(), bound.lengths(), bound.formats(),
                              1));
  } else {
    Require(PQsendQueryPrepared(connection_.get(), name.c_str(), bound.count(), bound.pointers(),
                                bound.lengths(), bound.formats(), 1));
  }
  sent_.push_back(required_rows);
}

PostgresResult PostgresConnection::Fetch(const std::string& sql,
                                         absl::Span<const PostgresValue> values) {
  Send(sql, values);
  return ReadResults();
}

PostgresResult PostgresConnection::ReadResults() {
  if (PQpipelineStatus(connection_.get()) == PQ_PIPELINE_OFF) return {};
  if (!alive()) ThrowLost();
  Require(PQpipelineSync(connection_.get()));
  std::string sqlstate, message;
  PostgresResult last;
  while (!sent_.empty()) {
    const int required_rows = std::exchange(sent_.front(), -1);
    while (PGresult* received = PQgetResult(connection_.get())) {
      PostgresResult result(received);
      const ExecStatusType status = PQresultStatus(received);
      if (status == PGRES_FATAL_ERROR && message.empty()) {
        const char* code = PQresultErrorField(received, PG_DIAG_SQLSTATE);
        sqlstate = code == nullptr ? PostgresError::kConnectionLost : code;
        message = OneLine(PQresultErrorMessage(received));
        if (message.empty()) message = "it failed without a message";
      } else if ((status == PGRES_COMMAND_OK || status == PGRES_TUPLES_OK) && message.empty() &&
                 required_rows >= 0 && result.changed_rows() != required_rows) {
        sqlstate = PostgresError::kTakenOver;
        message = "this server is not the one that writes any more";
      }
      last = std::move(result);
      if (!alive()) break;
    }
    sent_.pop_front();
    if (!alive()) break;
  }
  if (!alive()) {
    sent_.clear();
    if (message.empty()) ThrowLost();
    throw PostgresError(sqlstate, message);
  }
  const PostgresResult sync(PQgetResult(connection_.get()));
  if (PQresultStatus(sync.get()) != PGRES_PIPELINE_SYNC) ThrowLost();
  if (!message.empty()) {
    // What was prepared behind the error is not there.
    prepared_.clear();
    throw PostgresError(sqlstate, message);
  }
  return last;
}

std::vector<std::vector<std::string>> PostgresConnection::Run(const std::string& sql) {
  if (PQpipelineStatus(connection_.get()) != PQ_PIPELINE_OFF) {
    Flush();
    Require(PQexitPipelineMode(connection_.get()));
  }
  const PostgresResult result(PQexec(connection_.get(), sql.c_str()));
  const ExecStatusType status = PQresultStatus(result.get());
  if (status != PGRES_COMMAND_OK && status != PGRES_TUPLES_OK) {
    const char* code = PQresultErrorField(result.get(), PG_DIAG_SQLSTATE);
    throw PostgresError(code == nullptr ? PostgresError::kConnectionLost : code,
                        OneLine(PQerrorMessage(connection_.get())));
  }
  std::vector<std::vector<std::string>> rows(static_cast<size_t>(result.rows()));
  for (int row = 0; row < result.rows(); ++row) {
    for (int column = 0; column < PQnfields(result.get()); ++column) {
      rows[static_cast<size_t>(row)].emplace_back(result.Bytes(row, column));
    }
  }
  return rows;
}

void PostgresConnection::RollBack() {
  try {
    Flush();
  } catch (const PostgresError&) {
    // What was sent has failed with the transaction.
    if (!alive()) throw;
  }
  if (PQtransactionStatus(connection_.get()) != PQTRANS_IDLE) Fetch("ROLLBACK", {});
}

std::string NumberedParameters(std::string_view sql) {
  std::string numbered;
  int count = 0;
  bool quoted = false;
  for (size_t i = 0; i < sql.size(); ++i) {
    if (sql[i] == '\'') quoted = !quoted;
    if (quoted || sql[i] != '?') {
      numbered += sql[i];
      continue;
    }
    numbered += '$';
    if (i + 1 < sql.size() && absl::ascii_isdigit(static_cast<unsigned char>(sql[i + 1]))) continue;
    absl::StrAppend(&numbered, ++count);
  }
  return numbered;
}

std::string StorableText(std::string_view text) {
  constexpr std::string_view kReplacement = "\xEF\xBF\xBD";
  std::string storable;
  storable.reserve(text.size());
  for (size_t i = 0; i < text.size();) {
    const auto lead = static_cast<unsigned char>(text[i]);
    // RFC 3629, section 4: lengths, and the range of the second byte where it is narrower.
    size_t length = 1;
    unsigned char low = 0x80, high = 0xBF;
    if (lead >= 0xC2 && lead <= 0xDF) length = 2;
    if (lead >= 0xE0 && lead <= 0xEF) length = 3;
    if (lead >= 0xF0 && lead <= 0xF4) length = 4;
    if (lead == 0xE0) low = 0xA0;
    if (lead == 0xED) high = 0x9F;
    if (lead == 0xF0) low = 0x90;
    if (lead == 0xF4) high = 0x8F;
    bool good = lead != 0 && (lead < 0x80 || length > 1) && i + length <= text.size();
    for (size_t k = 1; good && k < length; ++k) {
      const auto next = static_cast<unsigned char>(text[i + k]);
      good = next >= (k == 1 ? low : 0x80) && next <= (k == 1 ? high : 0xBF);
    }
    storable += good ? text.substr(i, length) : kReplacement;
    i += good ? length : 1;
  }
  return storable;
}

}  // namespace rigcal::server

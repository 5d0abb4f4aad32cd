// SPDX-License-Identifier: Apache-2.0
#include "server/store/sql/table_copy.h"

#include <zlib.h>

#include <memory>
#include <string_view>

#include "absl/strings/str_cat.h"

namespace rigcal::server {
namespace {

// Read at once: a batch is a few megabytes at most.
constexpr int kBatchesAtOnce = 16;

// The columns in the order of their kinds: numbers, texts, blobs.
struct Table {
  const char* name;
  const char* numbers;  // names with commas between
  const char* texts;
  const char* blobs;
  const char* key;  // orders the rows
};

// Those that others refer to stand first.
constexpr Table kTables[] = {
    {"identity", "", "server_id", "", "server_id"},
    {"counter", "value", "name", "", "name"},
    {"session", "number,state,checksum", "id,rig", "body", "number"},
    {"session_summary", "record_number,checksum", "", "body", "record_number"},
    {"deleted_session", "number", "id", "", "id"},
    {"session_camera", "id,session_number,observation_count,wand_count,late_count", "camera", "",
     "id"},
    {"clock_epoch_count", "camera_id,clock_epoch,observation_count", "", "",
     "camera_id,clock_epoch"},
    {"refusal_count", "camera_id,count,example_stream_epoch,example_seq", "reason,example", "",
     "camera_id,reason"},
    {"stream",
     "id,camera_id,stream_epoch,durable_seq,last_seq,report_observation_count,report_refused_count",
     "", "", "id"},
    {"report_refusal", "stream_id,count", "reason,example", "", "stream_id,reason"},
    {"report_count", "stream_id,count", "name", "", "stream_id,name"},
    {"batch", "id,row_count,late", "", "body", "id"},
    {"damaged_batch", "batch_id,camera_id,row_count", "example", "", "batch_id"},
    {"dropped", "stream_id,first_seq,seq_count", "reason", "", "stream_id,first_seq"},
    {"clock_sample",
     "stream_id,clock_epoch,host_monotonic_ns,device_ns,host_utc_ns,uncertainty_ns,late,plausible",
     "", "", "stream_id,clock_epoch,host_monotonic_ns,device_ns,host_utc_ns,uncertainty_ns"},
    {"light_sample", "stream_id,clock_epoch,device_ns,light,light_ns,uncertainty_ns,late,plausible",
     "", "", "stream_id,clock_epoch,device_ns,light,light_ns,uncertainty_ns"},
    {"host_alignment",
     "stream_id,clock_epoch,host_monotonic_ns,server_minus_host_ns,uncertainty_ns,late,plausible",
     "", "", "stream_id,clock_epoch,host_monotonic_ns,server_minus_host_ns,uncertainty_ns"},
    {"calibration", "number,version,state,checksum", "id,rig", "body", "number"},
    {"calibration_summary", "record_number,checksum", "", "body", "record_number"},
    {"calibration_session", "calibration_number", "session_id", "",
     "session_id,calibration_number"},
    {"calibration_job",
     "calibration_number,state,attempts,fence,cancel,holder_pid,holder_is_server,lease_end_ms,"
     "stage,"
     "fraction_ppm,not_responding",
     "software_version,holder_host,holder_version", "", "calibration_number"},
    {"activation", "number,checksum", "rig,calibration_id", "body", "rig,number"},
};

int CountOf(std::string_view names) {
  if (names.empty()) return 0;
  int count = 1;
  for (const char letter : names) count += letter == ',' ? 1 : 0;
  return count;
}

void AddToDigest(std::string_view bytes, uint32_t* digest) {
  const uint64_t size = bytes.size();  // so that values cannot run into each other
  uLong crc = crc32_z(*digest, reinterpret_cast<const Bytef*>(&size), sizeof(size));
  crc = crc32_z(crc, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size());
  *digest = static_cast<uint32_t>(crc);
}

// Goes through the rows of one table.
class TableReader {
 public:
  // `to`: where each row is added; null: nowhere.
  TableReader(const Table& table, SqlDatabase& from, SqlDatabase* to)
      : table_(table),
        from_(from),
        number_count_(CountOf(table.numbers)),
        text_count_(CountOf(table.texts)),
        blob_count_(CountOf(table.blobs)),
        copied_{.name = table.name} {
    for (const char* names : {table.numbers, table.texts, table.blobs}) {
      if (*names != 0) absl::StrAppend(&columns_, columns_.empty() ? "" : ",", names);
    }
    if (to == nullptr) return;
    std::string values = "?";
    for (int i = 1; i < number_count_ + text_count_ + blob_count_; ++i) values += ",?";
    insert_ = std::make_unique<SqlStatement>(
        *to, absl::StrCat("INSERT INTO ", table.name, "(", columns_, ") VALUES(", values, ")"));
  }

  CopiedTable Run() {
    const std::string select = absl::StrCat("SELECT ", columns_, " FROM ", table_.name);
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
    int column = 0;
    for (; column < number_count_; ++column) {
      const int64_t number = row.Int64(column);
      const char null = row.IsNull(column) ? 1 : 0;
      AddToDigest({&null, 1}, &copied_.digest);
      AddToDigest({reinterpret_cast<const char*>(&number), sizeof(number)}, &copied_.digest);
      if (insert_ == nullptr) continue;
      if (null != 0) {
        insert_->Bind(column + 1, std::optional<uint32_t>());
      } else {
        insert_->Bind(column + 1, number);
      }
    }
    for (; column < number_count_ + text_count_ + blob_count_; ++column) {
      const std::string_view bytes = row.Bytes(column);
      AddToDigest(bytes, &copied_.digest);
      if (insert_ == nullptr) continue;
      if (column < number_count_ + text_count_) {
        insert_->Bind(column + 1, bytes);
      } else {
        insert_->Bind(column + 1, Blob{bytes});
      }
    }
    if (insert_ == nullptr) return;
    insert_->Run();
    insert_->Reset();
  }

  const Table& table_;
  SqlDatabase& from_;
  const int number_count_;
  const int text_count_;
  const int blob_count_;
  std::string columns_;
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
  for (const Table& table : kTables) copied.push_back(TableReader(table, from, &to).Run());
  return copied;
}

std::vector<CopiedTable> DigestTables(SqlDatabase& database) {
  std::vector<CopiedTable> read;
  for (const Table& table : kTables) read.push_back(TableReader(table, database, nullptr).Run());
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

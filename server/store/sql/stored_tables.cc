// SPDX-License-Identifier: Apache-2.0
#include "server/store/sql/stored_tables.h"

#include <zlib.h>

#include <algorithm>

#include "absl/strings/str_cat.h"

namespace rigcal::server {
namespace {

constexpr char kOfCameras[] =
    "camera_id IN (SELECT c.id FROM session_camera c JOIN session s ON c.session_number=s.number "
    "WHERE s.id=?1)";
constexpr char kOfStreams[] =
    "stream_id IN (SELECT t.id FROM stream t JOIN session_camera c ON t.camera_id=c.id "
    "JOIN session s ON c.session_number=s.number WHERE s.id=?1)";

constexpr StoredTable kTables[] = {
    {"identity", "", "server_id", "", "server_id", TableOwner::kShared, ""},
    {"counter", "value", "name", "", "name", TableOwner::kShared, ""},
    {"session", "number,state,checksum", "id,rig", "body", "number", TableOwner::kSession, "id=?1"},
    {"session_summary", "record_number,checksum", "", "body", "record_number", TableOwner::kSession,
     "record_number=(SELECT number FROM session WHERE id=?1)"},
    {"deleted_session", "number", "id", "", "id", TableOwner::kShared, ""},
    {"session_camera", "id,session_number,observation_count,wand_count,late_count", "camera", "",
     "id", TableOwner::kSession, "session_number=(SELECT number FROM session WHERE id=?1)"},
    {"clock_epoch_count", "camera_id,clock_epoch,observation_count", "", "",
     "camera_id,clock_epoch", TableOwner::kSession, kOfCameras},
    {"refusal_count", "camera_id,count,example_stream_epoch,example_seq", "reason,example", "",
     "camera_id,reason", TableOwner::kSession, kOfCameras},
    {"stream",
     "id,camera_id,stream_epoch,durable_seq,last_seq,report_observation_count,report_refused_count",
     "", "", "id", TableOwner::kSession, kOfCameras},
    {"report_refusal", "stream_id,count", "reason,example", "", "stream_id,reason",
     TableOwner::kSession, kOfStreams},
    {"report_count", "stream_id,count", "name", "", "stream_id,name", TableOwner::kSession,
     kOfStreams},
    {"batch", "id,row_count,late", "", "body", "id", TableOwner::kStreams,
     "id BETWEEN (?1<<32) AND (?1<<32)+4294967295"},
    {"damaged_batch", "batch_id,camera_id,row_count", "example", "", "batch_id",
     TableOwner::kSession, kOfCameras},
    {"dropped", "stream_id,first_seq,seq_count", "reason", "", "stream_id,first_seq",
     TableOwner::kSession, kOfStreams},
    {"clock_sample",
     "stream_id,clock_epoch,host_monotonic_ns,device_ns,host_utc_ns,uncertainty_ns,late,plausible",
     "", "", "stream_id,clock_epoch,host_monotonic_ns,device_ns,host_utc_ns,uncertainty_ns",
     TableOwner::kStreams, "stream_id=?1"},
    {"light_sample", "stream_id,clock_epoch,device_ns,light,light_ns,uncertainty_ns,late,plausible",
     "", "", "stream_id,clock_epoch,device_ns,light,light_ns,uncertainty_ns", TableOwner::kStreams,
     "stream_id=?1"},
    {"host_alignment",
     "stream_id,clock_epoch,host_monotonic_ns,server_minus_host_ns,uncertainty_ns,late,plausible",
     "", "", "stream_id,clock_epoch,host_monotonic_ns,server_minus_host_ns,uncertainty_ns",
     TableOwner::kStreams, "stream_id=?1"},
    {"calibration", "number,version,state,checksum", "id,rig", "body", "number",
     TableOwner::kCalibration, "id=?1"},
    {"calibration_summary", "record_number,checksum", "", "body", "record_number",
     TableOwner::kCalibration, "record_number=(SELECT number FROM calibration WHERE id=?1)"},
    {"calibration_session", "calibration_number", "session_id", "", "session_id,calibration_number",
     TableOwner::kCalibration, "calibration_number=(SELECT number FROM calibration WHERE id=?1)"},
    {"calibration_job",
     "calibration_number,state,attempts,fence,cancel,holder_pid,holder_is_server,lease_end_ms,stage,"
     "fraction_ppm,not_responding",
     "software_version,holder_host,holder_version", "", "calibration_number",
     TableOwner::kCalibration, "calibration_number=(SELECT number FROM calibration WHERE id=?1)"},
    {"activation", "number,checksum", "rig,calibration_id", "body", "rig,number",
     TableOwner::kActivations, ""},
};

int CountOf(std::string_view names) {
  if (names.empty()) return 0;
  return 1 + static_cast<int>(std::count(names.begin(), names.end(), ','));
}

}  // namespace

std::string StoredTable::Columns() const {
  std::string columns;
  for (const char* names : {numbers, texts, blobs}) {
    if (*names != 0) absl::StrAppend(&columns, columns.empty() ? "" : ",", names);
  }
  return columns;
}

int StoredTable::number_count() const { return CountOf(numbers); }
int StoredTable::text_count() const { return CountOf(texts); }
int StoredTable::blob_count() const { return CountOf(blobs); }

std::string StoredTable::Insertion() const {
  std::string values = "?";
  for (int i = 1; i < column_count(); ++i) values += ",?";
  return absl::StrCat("INSERT INTO ", name, "(", Columns(), ") VALUES(", values, ")");
}

absl::Span<const StoredTable> StoredTables() { return kTables; }

const StoredTable* FindStoredTable(std::string_view name) {
  const auto* const found = std::ranges::find(kTables, name, &StoredTable::name);
  return found == std::end(kTables) ? nullptr : found;
}

void AddToDigest(std::string_view bytes, uint32_t* digest) {
  const uint64_t size = bytes.size();
  uLong crc = crc32_z(*digest, reinterpret_cast<const Bytef*>(&size), sizeof(size));
  // zlib begins anew for a null pointer, which an empty value may have.
  if (!bytes.empty()) {
    crc = crc32_z(crc, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size());
  }
  *digest = static_cast<uint32_t>(crc);
}

void AddToDigest(const StoredTable& table, SqlStatement& row, uint32_t* digest) {
  int column = 0;
  for (; column < table.number_count(); ++column) {
    const int64_t number = row.Int64(column);
    const char null = row.IsNull(column) ? 1 : 0;
    AddToDigest({&null, 1}, digest);
    AddToDigest({reinterpret_cast<const char*>(&number), sizeof(number)}, digest);
  }
  for (; column < table.column_count(); ++column) AddToDigest(row.Bytes(column), digest);
}

}  // namespace rigcal::server

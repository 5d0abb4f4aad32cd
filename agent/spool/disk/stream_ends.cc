// SPDX-License-Identifier: Apache-2.0
#include "agent/spool/disk/stream_ends.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/spool/disk/byte_format.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

// Number of the stream, end, checksum of both.
constexpr size_t kEntryBytes = 12;

std::string EncodeEntry(uint32_t stream_number, uint32_t end_seq) {
  std::string entry;
  PutNumber(stream_number, &entry);
  PutNumber(end_seq, &entry);
  PutNumber(SpoolChecksum(entry), &entry);
  return entry;
}

}  // namespace

absl::StatusOr<StreamEnds> StreamEnds::Open(FileSystem& files, const std::string& folder) {
  const std::string path = absl::StrCat(folder, "/", kFileName);
  absl::StatusOr<std::shared_ptr<SpoolFile>> file = files.Open(path);
  if (absl::IsNotFound(file.status())) file = files.Create(path);
  RIGCAL_RETURN_IF_ERROR(file.status());
  return StreamEnds(*std::move(file));
}

absl::Status StreamEnds::Write(uint32_t stream_number, uint32_t end_seq) {
  return file_->WriteAt(uint64_t{stream_number} * kEntryBytes, EncodeEntry(stream_number, end_seq));
}

std::optional<uint32_t> StreamEnds::Read(uint32_t stream_number) const {
  const auto bytes = file_->ReadAt(uint64_t{stream_number} * kEntryBytes, kEntryBytes);
  if (!bytes.ok()) return std::nullopt;
  ByteReader reader(*bytes);
  reader.Take<uint32_t>();
  const auto end_seq = reader.Take<uint32_t>();
  if (*bytes != EncodeEntry(stream_number, end_seq)) return std::nullopt;
  return end_seq;
}

}  // namespace rigcal::agent

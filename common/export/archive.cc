// SPDX-License-Identifier: Apache-2.0
#include "common/export/archive.h"

#include <archive.h>
#include <archive_entry.h>

#include <memory>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"

namespace rigcal {
namespace {

// ZIP has no earlier time; of an export the calibration's own times count.
constexpr time_t kFirstZipTime = 315532800;  // 1980-01-01 UTC
constexpr mode_t kFileMode = 0644;

la_ssize_t Append(struct archive*, void* bytes, const void* data, size_t size) {
  static_cast<std::string*>(bytes)->append(static_cast<const char*>(data), size);
  return static_cast<la_ssize_t>(size);
}

absl::Status FailureOf(struct archive* zip) {
  const char* const why = archive_error_string(zip);
  return absl::InternalError(absl::StrCat("cannot make the archive: ", why ? why : "no memory"));
}

absl::Status AddFile(const ExportFile& file, struct archive* zip) {
  const std::unique_ptr<archive_entry, decltype(&archive_entry_free)> entry(archive_entry_new(),
                                                                            &archive_entry_free);
  if (entry == nullptr) return FailureOf(zip);
  archive_entry_set_pathname(entry.get(), file.name.c_str());
  archive_entry_set_size(entry.get(), static_cast<la_int64_t>(file.content.size()));
  archive_entry_set_filetype(entry.get(), AE_IFREG);
  archive_entry_set_perm(entry.get(), kFileMode);
  archive_entry_set_mtime(entry.get(), kFirstZipTime, 0);
  if (archive_write_header(zip, entry.get()) != ARCHIVE_OK ||
      archive_write_data(zip, file.content.data(), file.content.size()) !=
          static_cast<la_ssize_t>(file.content.size())) {
    return FailureOf(zip);
  }
  return absl::OkStatus();
}

// `choose` sets the format.
template <typename Choose>
absl::StatusOr<std::string> ArchiveOf(std::span<const ExportFile> files, Choose choose) {
  std::string bytes;
  const std::unique_ptr<archive, decltype(&archive_write_free)> result(archive_write_new(),
                                                                       &archive_write_free);
  if (result == nullptr || choose(result.get()) != ARCHIVE_OK ||
      archive_write_set_bytes_in_last_block(result.get(), 1) != ARCHIVE_OK ||
      archive_write_open(result.get(), &bytes, nullptr, &Append, nullptr) != ARCHIVE_OK) {
    return FailureOf(result.get());
  }
  for (const ExportFile& file : files) {
    if (absl::Status status = AddFile(file, result.get()); !status.ok()) return status;
  }
  if (archive_write_close(result.get()) != ARCHIVE_OK) return FailureOf(result.get());
  return bytes;
}

}  // namespace

absl::StatusOr<std::string> ZipOf(std::span<const ExportFile> files) {
  return ArchiveOf(files, archive_write_set_format_zip);
}

absl::StatusOr<std::string> TarGzOf(std::span<const ExportFile> files) {
  return ArchiveOf(files, [](struct archive* tar) {
    const int filter = archive_write_add_filter_gzip(tar);
    return filter == ARCHIVE_OK ? archive_write_set_format_ustar(tar) : filter;
  });
}

}  // namespace rigcal

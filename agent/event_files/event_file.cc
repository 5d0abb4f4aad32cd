// SPDX-License-Identifier: Apache-2.0
#include "agent/event_files/event_file.h"

#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <string_view>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "agent/event_files/csv_event_reader.h"
#include "agent/event_files/hdf5_event_reader.h"
#include "agent/event_files/plain_event_file.h"
#include "agent/event_files/raw_event_file.h"
#include "agent/event_files/sensor_geometry.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr std::string_view kHdf5Signature = "\x89HDF\r\n\x1a\n";
// HDF5 may follow a user block; then it begins at one of these.
constexpr std::array<long, 4> kHdf5Offsets = {0, 512, 1024, 2048};
// A comment of CSV files; RAW headers have a blank after the '%'.
constexpr std::string_view kCsvComment = "%geometry";
constexpr size_t kLookedAtBytes = 4096;

struct Front {
  std::string bytes;
  bool is_hdf5 = false;
  uint64_t byte_count = 0;
};

absl::Status ReadFront(const std::string& path, Front* front) {
  // Asked before opening: to open a pipe would wait for its other end.
  struct stat status = {};
  if (::stat(path.c_str(), &status) != 0) {
    return absl::ErrnoToStatus(errno, absl::StrCat("cannot open ", path));
  }
  if (!S_ISREG(status.st_mode)) {
    return absl::FailedPreconditionError(absl::StrCat(path, " is no file that can be read"));
  }
  front->byte_count = static_cast<uint64_t>(status.st_size);
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rbe"),
                                                             std::fclose);
  if (file == nullptr) return absl::ErrnoToStatus(errno, absl::StrCat("cannot open ", path));
  front->bytes.resize(kLookedAtBytes);
  front->bytes.resize(std::fread(front->bytes.data(), 1, front->bytes.size(), file.get()));
  const std::string_view bytes = front->bytes;
  for (const long offset : kHdf5Offsets) {
    const auto at = static_cast<size_t>(offset);
    front->is_hdf5 =
        front->is_hdf5 || (at < bytes.size() && bytes.substr(at).starts_with(kHdf5Signature));
  }
  return absl::OkStatus();
}

// The first byte that is in no text, or npos where so few are that it is a text with damage.
size_t FindBinary(std::string_view bytes) {
  constexpr size_t kDamagedOneIn = 20;
  const auto is_binary = [](char c) {
    const auto byte = static_cast<unsigned char>(c);
    return byte < 0x20 && byte != '\t' && byte != '\n' && byte != '\r';
  };
  const auto count = static_cast<size_t>(std::count_if(bytes.begin(), bytes.end(), is_binary));
  if (count * kDamagedOneIn <= bytes.size()) return bytes.npos;
  return static_cast<size_t>(std::find_if(bytes.begin(), bytes.end(), is_binary) - bytes.begin());
}

constexpr char kKnownFiles[] =
    "known: RAW files, which begin with '%' (EVT2, EVT21, EVT3), HDF5 and CSV";

}  // namespace

absl::StatusOr<std::unique_ptr<EventFile>> OpenEventFile(const std::string& path,
                                                         const PlainFileOptions& options) {
  Front front;
  RIGCAL_RETURN_IF_ERROR(ReadFront(path, &front));
  if (front.bytes.empty()) {
    return absl::InvalidArgumentError(absl::StrCat(path, " is empty; ", kKnownFiles));
  }
  std::unique_ptr<PlainEventReader> reader;
  if (front.is_hdf5) {
    RIGCAL_ASSIGN_OR_RETURN(reader, OpenHdf5Events(path, options));
  } else if (front.bytes.starts_with('%') && !front.bytes.starts_with(kCsvComment)) {
    RIGCAL_ASSIGN_OR_RETURN(RawEventFile raw, RawEventFile::Open(path));
    return std::make_unique<RawEventFile>(std::move(raw));
  } else if (const size_t at = FindBinary(front.bytes); at != std::string::npos) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ", byte ", at, ": this is no file of events (", kKnownFiles, ")"));
  } else {
    absl::StatusOr<std::unique_ptr<PlainEventReader>> csv = OpenCsvEvents(path, options);
    if (absl::IsInvalidArgument(csv.status())) {
      return absl::InvalidArgumentError(absl::StrCat(std::string(csv.status().message()),
                                                     "; byte 0 makes it neither RAW nor HDF5 (",
                                                     kKnownFiles, ")"));
    }
    RIGCAL_ASSIGN_OR_RETURN(reader, std::move(csv));
  }
  return std::make_unique<PlainEventFile>(std::move(reader), front.byte_count);
}

absl::StatusOr<std::optional<SensorGeometry>> GeometryOf(
    const std::string& path, const EventFileHeader& header,
    const std::optional<SensorGeometry>& given) {
  if (!given) return header.geometry;
  if (!header.geometry || *header.geometry == *given) return given;
  return absl::InvalidArgumentError(absl::StrCat(path, ": the file says ",
                                                 FormatSensorGeometry(*header.geometry),
                                                 " pixels, not ", FormatSensorGeometry(*given)));
}

}  // namespace rigcal::agent

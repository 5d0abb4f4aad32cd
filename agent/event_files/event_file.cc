// SPDX-License-Identifier: Apache-2.0
#include "agent/event_files/event_file.h"

#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <string_view>
#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/event_files/csv_event_line.h"
#include "agent/event_files/csv_event_reader.h"
#include "agent/event_files/hdf5_event_reader.h"
#include "agent/event_files/raw_event_file.h"
#include "agent/event_files/sensor_geometry.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

// A comment of CSV files; RAW headers have a blank after the '%'.
constexpr std::string_view kCsvComment = "%geometry";
constexpr size_t kLookedAtBytes = 4096;

absl::StatusOr<std::string> ReadFront(const std::string& path) {
  // Asked before opening: to open a pipe would wait for its other end.
  struct stat status = {};
  if (::stat(path.c_str(), &status) != 0) {
    return absl::ErrnoToStatus(errno, absl::StrCat("cannot open ", path));
  }
  if (!S_ISREG(status.st_mode)) {
    return absl::FailedPreconditionError(absl::StrCat(path, " is no file that can be read"));
  }
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rbe"),
                                                             std::fclose);
  if (file == nullptr) return absl::ErrnoToStatus(errno, absl::StrCat("cannot open ", path));
  std::string bytes(kLookedAtBytes, '\0');
  bytes.resize(std::fread(bytes.data(), 1, bytes.size(), file.get()));
  return bytes;
}

// HDF5 may follow a user block; then it begins at one of these.
bool IsHdf5(std::string_view bytes) {
  constexpr std::array<size_t, 4> kOffsets = {0, 512, 1024, 2048};
  return std::any_of(kOffsets.begin(), kOffsets.end(), [bytes](size_t at) {
    return at < bytes.size() && bytes.substr(at).starts_with("\x89HDF\r\n\x1a\n");
  });
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

const char* TimeUnitName(TimeUnit unit) {
  static constexpr const char* kNames[] = {"an unknown unit", "seconds", "microseconds",
                                           "nanoseconds", "milliseconds"};
  return kNames[static_cast<size_t>(unit)];
}

double MicrosecondsOf(TimeUnit unit) {
  static constexpr double kMicroseconds[] = {1, 1e6, 1, 1e-3, 1e3};
  return kMicroseconds[static_cast<size_t>(unit)];
}

const char* TimeUnitOption(TimeUnit unit) {
  static constexpr const char* kOptions[] = {"auto", "s", "us", "ns", "ms"};
  return kOptions[static_cast<size_t>(unit)];
}

void AddOptions(EventFileOptions* options, OptionTable* table) {
  table->AddChoice("time", &options->time_unit,
                   std::vector<std::pair<std::string, TimeUnit>>{{"auto", TimeUnit::kAuto},
                                                                 {"s", TimeUnit::kSeconds},
                                                                 {"ms", TimeUnit::kMilliseconds},
                                                                 {"us", TimeUnit::kMicroseconds},
                                                                 {"ns", TimeUnit::kNanoseconds}},
                   "unit of times in CSV or HDF5; auto: fractions are seconds, whole numbers "
                   "microseconds");
  const auto read = [columns = &options->columns](const std::string& text) {
    if (!ParseCsvEventOrder(text).ok()) {
      return absl::InvalidArgumentError("must be an order of x, y, p and t, such as txyp");
    }
    *columns = text;
    return absl::OkStatus();
  };
  table->Add("columns", "ORDER", "of CSV without a header line", read,
             [columns = &options->columns] { return *columns; });
  table->AddChoice("endianness", &options->evt21_order,
                   std::vector<std::pair<std::string, Evt21Order>>{{"auto", Evt21Order::kAuto},
                                                                   {"little", Evt21Order::kLittle},
                                                                   {"legacy", Evt21Order::kLegacy}},
                   "of EVT 2.1; auto: as its header says, legacy where it says nothing");
}

absl::StatusOr<std::unique_ptr<EventFile>> OpenEventFile(const std::string& path,
                                                         const EventFileOptions& options) {
  RIGCAL_ASSIGN_OR_RETURN(const std::string front, ReadFront(path));
  if (front.empty()) {
    return InvalidFile(path, " is empty; ", kKnownFiles);
  }
  if (IsHdf5(front)) return OpenHdf5Events(path, options);
  if (front.starts_with('%') && !front.starts_with(kCsvComment)) {
    return OpenRawEvents(path, options);
  }
  if (const size_t at = FindBinary(front); at != std::string::npos) {
    return InvalidFile(path, ", byte ", at, ": this is no file of events (", kKnownFiles, ")");
  }
  auto csv = OpenCsvEvents(path, options);
  if (!absl::IsInvalidArgument(csv.status())) return csv;
  return InvalidFile(std::string(csv.status().message()),
                     "; byte 0 makes it neither RAW nor HDF5 (", kKnownFiles, ")");
}

absl::StatusOr<std::optional<SensorGeometry>> GeometryOf(
    const std::string& path, const EventFileHeader& header,
    const std::optional<SensorGeometry>& given) {
  if (!given) return header.geometry;
  if (!header.geometry || *header.geometry == *given) return given;
  return InvalidFile(path, ": the file says ", FormatSensorGeometry(*header.geometry),
                     " pixels, not ", FormatSensorGeometry(*given));
}

}  // namespace rigcal::agent

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <cstdio>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "absl/status/statusor.h"
#include "agent/event/plain_events.h"

namespace rigcal::agent {

// Header of a new file.
struct PlainFileFront {
  std::optional<SensorGeometry> geometry;
  std::map<std::string, std::string> fields;  // "serial_number" and so on, if the format allows
};

// What a file's format could not hold.
struct WriterLosses {
  uint64_t triggers = 0;      // left out: no triggers, or none of this channel
  uint64_t moved_events = 0;  // written with a time that is at most 1 ms too late
};

// Writes events into a file for interchange. One thread at a time. Errors name the file.
class PlainEventWriter {
 public:
  virtual ~PlainEventWriter() = default;

  // Events in the order of their stream. FAILED_PRECONDITION: a time that the format cannot hold.
  // DATA_LOSS: the file cannot be written.
  virtual absl::Status Write(std::span<const PlainEvent> events) = 0;
  // Once, at the end: completes and closes the file. DATA_LOSS.
  virtual absl::Status Finish() = 0;
  WriterLosses losses() const { return losses_; }

 protected:
  WriterLosses losses_;
};

// A file that is written to its end. Errors name it.
class OutputFile {
 public:
  // FAILED_PRECONDITION.
  static absl::StatusOr<OutputFile> Create(const std::string& path);
  const std::string& path() const { return path_; }
  absl::Status Write(std::span<const uint8_t> bytes);
  absl::Status Write(const std::string& text);
  absl::Status Finish();

 private:
  OutputFile(std::string path, std::FILE* file)
      : path_(std::move(path)), file_(file, std::fclose) {}
  absl::Status Check(bool done) const;

  std::string path_;
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_;
};

// INVALID_ARGUMENT: the ending of this path is none of those below.
absl::Status CheckEventFileEnding(const std::string& path);

// By the ending: .raw, .csv (or .txt), .h5 or .hdf5. `layout`: of HDF5, "compound" or "events".
//
// CSV: x,y,p,t with a header line, times in microseconds, polarity 0 or 1; the geometry, where it
// is known, as a comment in front. No triggers.
//
// RAW: EVT 3.0. Its times have 24 bits: silence of more than some seconds and times that begin
// later than the first 16 s are told by TIME_HIGH words that count the overflows, so that decoders
// of RAW files read back the whole time. A step back of a millisecond or more begins a new clock
// epoch there as well; smaller ones across a TIME_HIGH border are taken out.
//
// With `raw` kEvt2 the same in EVT 2.0, which more programs read. It holds times
// of up to 4 hours and 46 minutes that do not step back by a millisecond: FAILED_PRECONDITION.
//
// INVALID_ARGUMENT: another ending, or what the format needs is missing (RAW: the geometry).
// FAILED_PRECONDITION: the file cannot be made.
absl::StatusOr<std::unique_ptr<PlainEventWriter>> CreateEventFileWriter(const std::string& path,
                                                                        std::string_view ending,
                                                                        const PlainFileFront& front,
                                                                        const std::string& layout,
                                                                        EventFormat raw);

}  // namespace rigcal::agent

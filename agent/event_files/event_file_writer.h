// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "agent/event/evt3_writer.h"
#include "agent/event_files/plain_event_writer.h"

namespace rigcal::agent {

// A file that is written to its end. Errors name it.
class OutputFile {
 public:
  // FAILED_PRECONDITION.
  static absl::StatusOr<OutputFile> Create(const std::string& path);
  absl::Status Write(std::span<const uint8_t> bytes);
  absl::Status Finish();

 private:
  OutputFile(std::string path, std::FILE* file)
      : path_(std::move(path)), file_(file, std::fclose) {}
  std::string path_;
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_;
};

// x,y,p,t with a header line, times in microseconds, polarity 0 or 1; the geometry, where it is
// known, as a comment in front. No triggers.
class CsvEventWriter : public PlainEventWriter {
 public:
  static absl::StatusOr<std::unique_ptr<CsvEventWriter>> Create(const std::string& path,
                                                                const PlainFileFront& front);
  absl::Status Write(std::span<const PlainEvent> events) override;
  absl::Status Finish() override;
  WriterLosses losses() const override { return losses_; }

 private:
  explicit CsvEventWriter(OutputFile file) : file_(std::move(file)) {}
  OutputFile file_;
  std::vector<uint8_t> text_;
  WriterLosses losses_;
};

// EVT 3.0. Its times have 24 bits: silence of more than some seconds and times that begin later
// than the first 16 s are told by TIME_HIGH words that count the overflows, so that RawEventFile's
// decoders read back the whole time. A step back of a millisecond or more begins a new clock epoch
// there as well; smaller ones across a TIME_HIGH border are taken out.
class RawEventWriter : public PlainEventWriter {
 public:
  // INVALID_ARGUMENT: no geometry.
  static absl::StatusOr<std::unique_ptr<RawEventWriter>> Create(const std::string& path,
                                                                const PlainFileFront& front);
  absl::Status Write(std::span<const PlainEvent> events) override;
  absl::Status Finish() override;
  WriterLosses losses() const override { return losses_; }

 private:
  RawEventWriter(std::string path, OutputFile file)
      : path_(std::move(path)), file_(std::move(file)) {}
  // Makes this time one that the writer can go on to.
  absl::Status GoTo(int64_t* time_us);
  absl::Status Climb(int64_t high);
  void StepBack();
  void WriteHigh(int64_t high);
  void WriteRun();

  std::string path_;
  OutputFile file_;
  Evt3Writer writer_;
  std::optional<int64_t> high_;  // time that was written last, in units of 4096 us
  std::vector<CdEvent> run_;
  std::vector<uint8_t> words_;
  WriterLosses losses_;
};

// INVALID_ARGUMENT: the ending of this path is none of those below.
absl::Status CheckEventFileEnding(const std::string& path);

// By the ending of the path: .raw, .csv (or .txt), .h5 or .hdf5. `layout`: of HDF5, "prophesee" or
// "events". INVALID_ARGUMENT: another ending, or what the format needs is missing.
absl::StatusOr<std::unique_ptr<PlainEventWriter>> CreateEventFileWriter(const std::string& path,
                                                                        std::string_view ending,
                                                                        const PlainFileFront& front,
                                                                        const std::string& layout);

}  // namespace rigcal::agent

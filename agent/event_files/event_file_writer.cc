// SPDX-License-Identifier: Apache-2.0
#include "agent/event_files/event_file_writer.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "agent/event_files/hdf5_event_writer.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr size_t kTextBufferBytes = size_t{1} << 20;

template <typename Number>
void AppendNumber(Number number, char end, std::vector<uint8_t>* text) {
  std::array<char, 24> digits;
  const auto [stopped, error] = std::to_chars(digits.data(), digits.data() + digits.size(), number);
  text->insert(text->end(), digits.data(), stopped);
  text->push_back(static_cast<uint8_t>(end));
}

std::span<const uint8_t> Bytes(const std::string& text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), text.size()};
}

absl::Status UnknownEnding(std::string_view ending) {
  return absl::InvalidArgumentError(
      absl::StrCat("\"", std::string(ending),
                   "\" is no ending of a file of events: .raw (EVT 3.0), .csv, .h5 or .hdf5"));
}

}  // namespace

absl::Status CheckEventFileEnding(const std::string& path) {
  const std::string ending =
      absl::AsciiStrToLower(std::filesystem::path(path).extension().string());
  for (const char* const known : {".csv", ".txt", ".raw", ".h5", ".hdf5"}) {
    if (ending == known) return absl::OkStatus();
  }
  return UnknownEnding(ending);
}

absl::StatusOr<OutputFile> OutputFile::Create(const std::string& path) {
  std::FILE* const file = std::fopen(path.c_str(), "wbe");
  if (file == nullptr) {
    return absl::FailedPreconditionError(
        absl::StrCat("cannot make ", path, ": ", std::strerror(errno)));
  }
  return OutputFile(path, file);
}

absl::Status OutputFile::Write(std::span<const uint8_t> bytes) {
  if (std::fwrite(bytes.data(), 1, bytes.size(), file_.get()) == bytes.size()) {
    return absl::OkStatus();
  }
  return absl::DataLossError(absl::StrCat("cannot write ", path_, ": ", std::strerror(errno)));
}

absl::Status OutputFile::Finish() {
  if (std::fclose(file_.release()) == 0) return absl::OkStatus();
  return absl::DataLossError(absl::StrCat("cannot write ", path_, ": ", std::strerror(errno)));
}

absl::StatusOr<std::unique_ptr<CsvEventWriter>> CsvEventWriter::Create(
    const std::string& path, const PlainFileFront& front) {
  RIGCAL_ASSIGN_OR_RETURN(OutputFile file, OutputFile::Create(path));
  std::string text = "x,y,p,t\n";
  if (front.geometry) {
    text =
        absl::StrCat("%geometry:", front.geometry->width, ",", front.geometry->height, "\n", text);
  }
  RIGCAL_RETURN_IF_ERROR(file.Write(Bytes(text)));
  return std::unique_ptr<CsvEventWriter>(new CsvEventWriter(std::move(file)));
}

absl::Status CsvEventWriter::Write(std::span<const PlainEvent> events) {
  for (const PlainEvent& event : events) {
    if (event.kind > PlainEvent::kOn) {
      losses_.triggers += event.kind < PlainEvent::kUnreadable ? 1 : 0;
      continue;
    }
    AppendNumber(event.x, ',', &text_);
    AppendNumber(event.y, ',', &text_);
    AppendNumber(event.kind == PlainEvent::kOn ? 1 : 0, ',', &text_);
    AppendNumber(event.time_us, '\n', &text_);
    if (text_.size() < kTextBufferBytes) continue;
    RIGCAL_RETURN_IF_ERROR(file_.Write(text_));
    text_.clear();
  }
  return absl::OkStatus();
}

absl::Status CsvEventWriter::Finish() {
  RIGCAL_RETURN_IF_ERROR(file_.Write(text_));
  return file_.Finish();
}

absl::StatusOr<std::unique_ptr<PlainEventWriter>> CreateEventFileWriter(const std::string& path,
                                                                        std::string_view ending,
                                                                        const PlainFileFront& front,
                                                                        const std::string& layout) {
  if (ending == ".csv" || ending == ".txt") return CsvEventWriter::Create(path, front);
  if (ending == ".raw") return RawEventWriter::Create(path, front);
  if (ending == ".h5" || ending == ".hdf5") {
    return CreateHdf5EventWriter(
        path, front, layout == "events" ? Hdf5EventLayout::kColumns : Hdf5EventLayout::kProphesee);
  }
  return UnknownEnding(ending);
}

}  // namespace rigcal::agent

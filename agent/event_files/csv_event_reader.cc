// SPDX-License-Identifier: Apache-2.0
#include "agent/event_files/csv_event_reader.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "agent/event_files/csv_event_line.h"
#include "agent/event_files/sensor_geometry.h"
#include "common/status/status_macros.h"
#include "common/text/line_reader.h"

namespace rigcal::agent {
namespace {

constexpr int kLinesLookedAt = 1000;
constexpr uint64_t kBadLinesAtLeast = 1000;

bool IsBlank(std::string_view text) { return text.find_first_not_of(" \t\r") == text.npos; }
bool IsComment(std::string_view text) { return text.starts_with('#') || text.starts_with('%'); }

// Of a text with two numbers.
std::optional<SensorGeometry> Sides(std::string text) {
  const auto is_no_digit = [](char c) {
    return !absl::ascii_isdigit(static_cast<unsigned char>(c));
  };
  std::replace_if(text.begin(), text.end(), is_no_digit, ' ');
  const std::vector<std::string> numbers = absl::StrSplit(text, ' ', absl::SkipEmpty());
  return numbers.size() == 2 ? ParseSensorGeometry(numbers[0], numbers[1]) : std::nullopt;
}

class CsvEventReader : public PlainEventReader {
 public:
  CsvEventReader(std::string path, LineReader lines)
      : path_(std::move(path)), lines_(std::move(lines)) {}

  // Looks at the first lines of the file.
  absl::Status Look(const EventFileOptions& options);

  absl::Status Read(size_t max_count, std::vector<PlainEvent>* events) override;
  std::string PlaceInBlock(size_t index) const override {
    return absl::StrCat("line ", line_numbers_[index]);
  }
  std::vector<Refusal> Refused() const override { return refused_.List(); }

 private:
  // What the lines ahead of the first event say; false: `line` is none of these.
  absl::StatusOr<bool> TakeFront(const LineReader::Line& line);
  absl::Status CountBad(uint64_t line, const std::string& what);

  const std::string path_;
  LineReader lines_;
  CsvEventColumns columns_;
  bool has_header_ = false;
  uint64_t first_line_ = 0;  // with an event
  std::vector<uint64_t> line_numbers_;
  uint64_t good_ = 0, bad_ = 0;
  RefusalCounter refused_;
};

absl::StatusOr<bool> CsvEventReader::TakeFront(const LineReader::Line& line) {
  if (IsBlank(line.text)) return true;
  if (IsComment(line.text)) {
    const std::string text = absl::AsciiStrToLower(std::string(line.text));
    const size_t at = text.find("geometry");
    if (at != text.npos) header_.geometry = Sides(text.substr(at));
    return true;
  }
  if (!has_header_ && IsCsvEventHeader(line.text)) {
    const absl::StatusOr<CsvEventColumns> columns = ParseCsvEventHeader(line.text);
    if (!columns.ok()) {
      return InvalidFile(path_, ":", line.number, ": ", std::string(columns.status().message()));
    }
    columns_ = *columns;
    has_header_ = true;
    return true;
  }
  if (!header_.geometry && SplitCsvEventFields(line.text).size() == 2) {
    header_.geometry = Sides(std::string(line.text));
    return header_.geometry.has_value();
  }
  return false;
}

absl::Status CsvEventReader::Look(const EventFileOptions& options) {
  RIGCAL_ASSIGN_OR_RETURN(columns_, ParseCsvEventOrder(options.columns));
  RIGCAL_ASSIGN_OR_RETURN(LineReader reader, LineReader::Open(path_));
  int events = 0, looked_at = 0;
  bool has_fraction = false;
  int64_t first_time = 0;
  std::string first_fault;
  while (looked_at < kLinesLookedAt) {
    RIGCAL_ASSIGN_OR_RETURN(const auto line, reader.Next());
    if (!line) break;
    if (first_line_ == 0) {
      RIGCAL_ASSIGN_OR_RETURN(const bool is_front, TakeFront(*line));
      if (is_front) continue;
      first_line_ = line->number;
    }
    if (IsBlank(line->text) || IsComment(line->text)) continue;
    ++looked_at;
    PlainEvent event;
    if (const auto fault =
            ParseCsvEventLine(line->text, columns_, TimeUnit::kMicroseconds, &event)) {
      if (first_fault.empty()) first_fault = absl::StrCat(":", line->number, ": ", *fault);
      continue;
    }
    if (events++ == 0) first_time = event.time_us;
    has_fraction = has_fraction || HasTimeFraction(line->text, columns_);
  }
  if (events == 0 && (looked_at > 0 || !has_header_)) {
    return InvalidFile(
        path_, first_fault, looked_at > 0 ? "; none of the first lines is" : ": there is no",
        " an event as CSV (x,y,p,t such as 320,240,1,1000000; other orders with a header line or ",
        "columns=txyp)");
  }
  header_.format_name = "CSV";
  header_.time_unit = options.time_unit != TimeUnit::kAuto ? options.time_unit : columns_.time_unit;
  if (header_.time_unit == TimeUnit::kAuto) {
    header_.time_unit = has_fraction ? TimeUnit::kSeconds : TimeUnit::kMicroseconds;
    if (std::abs(static_cast<double>(first_time)) > static_cast<double>(PlainClock::kMaxUs)) {
      return InvalidFile(path_, ":", first_line_, ": a time of ", first_time,
                         " is too large for microseconds; say what it is: time=ns");
    }
  }
  header_.layout = has_header_ ? "columns of its header line" : "columns " + options.columns;
  return absl::OkStatus();
}

absl::Status CsvEventReader::CountBad(uint64_t line, const std::string& what) {
  ++bad_;
  refused_.Add("", RefusalReason::kEventCsvBadLine, 1, absl::StrCat(path_, ":", line, ": ", what));
  if (bad_ <= kBadLinesAtLeast || bad_ <= good_) return absl::OkStatus();
  return absl::DataLossError(absl::StrCat(path_, ":", line, ": ", bad_, " of ", bad_ + good_,
                                          " lines so far are no events, the last one has ", what,
                                          "; is this the right file?"));
}

absl::Status CsvEventReader::Read(size_t max_count, std::vector<PlainEvent>* events) {
  events->clear();
  line_numbers_.clear();
  while (events->size() < max_count) {
    RIGCAL_ASSIGN_OR_RETURN(const auto line, lines_.Next());
    if (!line) break;
    if (line->number < first_line_ || first_line_ == 0) continue;
    if (IsBlank(line->text) || IsComment(line->text)) continue;
    PlainEvent event;
    std::optional<std::string> fault;
    if (line->too_long) {
      fault = absl::StrCat("more than ", LineReader::kMaxLineBytes, " bytes");
    } else {
      fault = ParseCsvEventLine(line->text, columns_, header_.time_unit, &event);
    }
    if (fault) {
      RIGCAL_RETURN_IF_ERROR(CountBad(line->number, *fault));
      continue;
    }
    ++good_;
    events->push_back(event);
    line_numbers_.push_back(line->number);
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::unique_ptr<PlainEventReader>> OpenCsvEvents(const std::string& path,
                                                                const EventFileOptions& options) {
  RIGCAL_ASSIGN_OR_RETURN(LineReader lines, LineReader::Open(path));
  auto reader = std::make_unique<CsvEventReader>(path, std::move(lines));
  RIGCAL_RETURN_IF_ERROR(reader->Look(options));
  return reader;
}

}  // namespace rigcal::agent

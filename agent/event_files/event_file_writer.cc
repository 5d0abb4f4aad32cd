// SPDX-License-Identifier: Apache-2.0
#include "agent/event_files/event_file_writer.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "agent/event/evt2_writer.h"
#include "agent/event/evt3_writer.h"
#include "agent/event_files/hdf5_event_writer.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr size_t kBufferBytes = size_t{1} << 20;
constexpr size_t kMaxRunEvents = 4096;
constexpr uint8_t kChannels = 16;      // four bits
constexpr uint8_t kEvt2Channels = 32;  // five bits
// TIME_HIGH words, as TimeHigh weighs them: it believes steps of up to kStep at once, longer ones
// of up to half a period once the next word confirms them, and takes a jump from below kTop to
// kStep or less for a restart.
constexpr int64_t kPeriod = 0x1000;
constexpr int64_t kStep = 16;
constexpr int64_t kJump = 0x700;
constexpr int64_t kTop = kPeriod - 1 - kStep;
// 12 days of overflows to count make half a megabyte.
constexpr int64_t kMaxClimb = int64_t{1} << 28;

int64_t High(int64_t time_us) { return time_us >> 12; }

CdEvent ChangeAt(int64_t time_us, const PlainEvent& event) {
  return {.time_us = time_us, .x = event.x, .y = event.y, .on = event.kind == PlainEvent::kOn};
}

TriggerEvent TriggerAt(int64_t time_us, const PlainEvent& event) {
  return {.time_us = time_us,
          .channel = event.channel,
          .rising = event.kind == PlainEvent::kTriggerRising};
}

class CsvEventWriter : public PlainEventWriter {
 public:
  explicit CsvEventWriter(OutputFile file) : file_(std::move(file)) {}
  absl::Status Begin(const PlainFileFront& front);
  absl::Status Write(std::span<const PlainEvent> events) override;
  absl::Status Finish() override;

 private:
  OutputFile file_;
  std::vector<uint8_t> text_;
};

template <typename Number>
void AppendNumber(Number number, char end, std::vector<uint8_t>* text) {
  std::array<char, 24> digits;
  const auto [stopped, error] = std::to_chars(digits.data(), digits.data() + digits.size(), number);
  text->insert(text->end(), digits.data(), stopped);
  text->push_back(static_cast<uint8_t>(end));
}

absl::Status CsvEventWriter::Begin(const PlainFileFront& front) {
  std::string text = "x,y,p,t\n";
  if (front.geometry) {
    text =
        absl::StrCat("%geometry:", front.geometry->width, ",", front.geometry->height, "\n", text);
  }
  return file_.Write(text);
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
    if (text_.size() < kBufferBytes) continue;
    RIGCAL_RETURN_IF_ERROR(file_.Write(text_));
    text_.clear();
  }
  return absl::OkStatus();
}

absl::Status CsvEventWriter::Finish() {
  RIGCAL_RETURN_IF_ERROR(file_.Write(text_));
  return file_.Finish();
}

class RawEventWriter : public PlainEventWriter {
 public:
  explicit RawEventWriter(OutputFile file) : file_(std::move(file)) {}
  absl::Status Begin(const PlainFileFront& front);
  absl::Status Write(std::span<const PlainEvent> events) override;
  absl::Status Finish() override;

 private:
  // Makes this time one that the writer can go on to.
  absl::Status GoTo(int64_t* time_us);
  absl::Status Climb(int64_t high);
  void StepBack();
  void WriteHigh(int64_t high);
  void WriteRun();

  OutputFile file_;
  Evt3Writer writer_;
  std::optional<int64_t> high_;  // time that was written last, in units of 4096 us
  std::vector<CdEvent> run_;
  std::vector<uint8_t> words_;
};

std::string SerialNumber(const PlainFileFront& front) {
  const auto serial = front.fields.find("serial_number");
  return serial == front.fields.end() ? "unknown" : serial->second;
}

absl::Status RawEventWriter::Begin(const PlainFileFront& front) {
  return file_.Write(Evt3Header(*front.geometry, SerialNumber(front)));
}

void RawEventWriter::WriteHigh(int64_t high) {
  writer_.WriteTime(high * kPeriod, &words_);
  high_ = high;
}

absl::Status RawEventWriter::Climb(int64_t high) {
  if (high - *high_ > kMaxClimb) {
    return absl::FailedPreconditionError(
        absl::StrCat(file_.path(), ": EVT 3.0 counts 16 s at a time and cannot tell a time of ",
                     high * kPeriod, " us; write HDF5 or CSV"));
  }
  while (high - *high_ > kStep) {
    int64_t next = std::min(high, *high_ + kJump);
    const bool looks_like_restart = next % kPeriod <= kStep && *high_ % kPeriod <= kTop;
    if (looks_like_restart && next / kPeriod != *high_ / kPeriod) {
      next = next / kPeriod * kPeriod - kStep / 2;
    }
    WriteHigh(next);
    if (next < high) WriteHigh(next + 1);
  }
  return absl::OkStatus();
}

void RawEventWriter::StepBack() {
  WriteHigh(*high_ + 1);  // confirms the last one: it may have been a jump
  // From where a jump to zero is taken for a restart.
  const int64_t value = *high_ % kPeriod;
  if (value <= kStep || value > kTop) {
    WriteHigh(*high_ + 4 * kStep);
    WriteHigh(*high_ + 1);
  }
  for (int i = 0; i < 2; ++i) {
    writer_ = Evt3Writer();
    WriteHigh(0);
  }
}

absl::Status RawEventWriter::GoTo(int64_t* time_us) {
  if (*time_us < 0) {
    return absl::FailedPreconditionError(absl::StrCat(file_.path(),
                                                      ": a sensor's time cannot be negative, as ",
                                                      *time_us, " us is; write HDF5 or CSV"));
  }
  if (!high_) {
    WriteHigh(std::min(High(*time_us), kPeriod - 1));
    // A first word that a jump follows is confirmed, too.
    if (*high_ < High(*time_us)) WriteHigh(*high_ + 1);
  }
  int64_t high = High(*time_us);
  if (high < *high_) {
    if (*high_ * kPeriod - *time_us <= PlainClock::kJitterUs) {
      ++losses_.moved_events;
      *time_us = *high_ * kPeriod;
      return absl::OkStatus();
    }
    StepBack();
    high = High(*time_us);
  }
  RIGCAL_RETURN_IF_ERROR(Climb(high));
  high_ = high;
  return absl::OkStatus();
}

void RawEventWriter::WriteRun() {
  writer_.Write(run_, &words_);
  run_.clear();
}

absl::Status RawEventWriter::Write(std::span<const PlainEvent> events) {
  for (const PlainEvent& event : events) {
    if (event.kind >= PlainEvent::kUnreadable) continue;
    const bool is_trigger = event.kind >= PlainEvent::kTriggerFalling;
    if (is_trigger && event.channel >= kChannels) {
      ++losses_.triggers;
      continue;
    }
    int64_t time_us = event.time_us;
    if (!high_ || High(time_us) != *high_ || is_trigger || run_.size() >= kMaxRunEvents) {
      WriteRun();
      RIGCAL_RETURN_IF_ERROR(GoTo(&time_us));
    }
    if (is_trigger) {
      writer_.Write(TriggerAt(time_us, event), &words_);
    } else {
      run_.push_back(ChangeAt(time_us, event));
    }
    if (words_.size() < kBufferBytes) continue;
    RIGCAL_RETURN_IF_ERROR(file_.Write(words_));
    words_.clear();
  }
  return absl::OkStatus();
}

absl::Status RawEventWriter::Finish() {
  WriteRun();
  RIGCAL_RETURN_IF_ERROR(file_.Write(words_));
  return file_.Finish();
}

// RAW in EVT 2.0, whose words hold all times of a recording.
class Evt2FileWriter : public PlainEventWriter {
 public:
  explicit Evt2FileWriter(OutputFile file) : file_(std::move(file)) {}
  absl::Status Begin(const PlainFileFront& front) {
    return file_.Write(Evt2Header(*front.geometry, SerialNumber(front)));
  }
  absl::Status Write(std::span<const PlainEvent> events) override;
  absl::Status Finish() override {
    RIGCAL_RETURN_IF_ERROR(file_.Write(words_));
    return file_.Finish();
  }

 private:
  OutputFile file_;
  Evt2Writer writer_;
  int64_t last_us_ = 0;
  std::vector<uint8_t> words_;
};

absl::Status Evt2FileWriter::Write(std::span<const PlainEvent> events) {
  for (const PlainEvent& event : events) {
    if (event.kind >= PlainEvent::kUnreadable) continue;
    const bool is_trigger = event.kind >= PlainEvent::kTriggerFalling;
    if (is_trigger && event.channel >= kEvt2Channels) {
      ++losses_.triggers;
      continue;
    }
    int64_t time_us = event.time_us;
    if (time_us < last_us_ && last_us_ - time_us <= PlainClock::kJitterUs) {
      ++losses_.moved_events;
      time_us = last_us_;
    }
    if (time_us < last_us_ || time_us > Evt2Writer::kMaxTimeUs) {
      return absl::FailedPreconditionError(
          absl::StrCat(file_.path(), ": EVT 2.0 holds times of 0 to ", Evt2Writer::kMaxTimeUs,
                       " us that do not step back; ", time_us, " us after ", last_us_,
                       " us is none: write EVT 3.0, HDF5 or CSV"));
    }
    last_us_ = time_us;
    if (is_trigger) {
      writer_.Write(TriggerAt(time_us, event), &words_);
    } else {
      const CdEvent change = ChangeAt(time_us, event);
      writer_.Write({&change, 1}, &words_);
    }
    if (words_.size() < kBufferBytes) continue;
    RIGCAL_RETURN_IF_ERROR(file_.Write(words_));
    words_.clear();
  }
  return absl::OkStatus();
}

absl::Status UnknownEnding(std::string_view ending) {
  return InvalidFile("\"", std::string(ending),
                     "\" is no ending of a file of events: .raw (EVT 3.0), .csv, .h5 or .hdf5");
}

template <typename Writer>
absl::StatusOr<std::unique_ptr<PlainEventWriter>> CreateWriter(const std::string& path,
                                                               const PlainFileFront& front) {
  RIGCAL_ASSIGN_OR_RETURN(OutputFile file, OutputFile::Create(path));
  auto writer = std::make_unique<Writer>(std::move(file));
  RIGCAL_RETURN_IF_ERROR(writer->Begin(front));
  return writer;
}

}  // namespace

absl::StatusOr<OutputFile> OutputFile::Create(const std::string& path) {
  std::FILE* const file = std::fopen(path.c_str(), "wbe");
  if (file != nullptr) return OutputFile(path, file);
  return absl::FailedPreconditionError(
      absl::StrCat("cannot make ", path, ": ", std::strerror(errno)));
}

absl::Status OutputFile::Write(std::span<const uint8_t> bytes) {
  return Check(std::fwrite(bytes.data(), 1, bytes.size(), file_.get()) == bytes.size());
}

absl::Status OutputFile::Write(const std::string& text) {
  return Write({reinterpret_cast<const uint8_t*>(text.data()), text.size()});
}

absl::Status OutputFile::Finish() { return Check(std::fclose(file_.release()) == 0); }

absl::Status OutputFile::Check(bool done) const {
  if (done) return absl::OkStatus();
  return absl::DataLossError(absl::StrCat("cannot write ", path_, ": ", std::strerror(errno)));
}

absl::Status CheckEventFileEnding(const std::string& path) {
  const std::string ending =
      absl::AsciiStrToLower(std::filesystem::path(path).extension().string());
  for (const char* const known : {".csv", ".txt", ".raw", ".h5", ".hdf5"}) {
    if (ending == known) return absl::OkStatus();
  }
  return UnknownEnding(ending);
}

absl::StatusOr<std::unique_ptr<PlainEventWriter>> CreateEventFileWriter(const std::string& path,
                                                                        std::string_view ending,
                                                                        const PlainFileFront& front,
                                                                        const std::string& layout,
                                                                        EventFormat raw) {
  if (ending == ".csv" || ending == ".txt") return CreateWriter<CsvEventWriter>(path, front);
  if (ending == ".raw") {
    if (front.geometry) {
      return raw == EventFormat::kEvt2 ? CreateWriter<Evt2FileWriter>(path, front)
                                       : CreateWriter<RawEventWriter>(path, front);
    }
    return absl::InvalidArgumentError(
        "a RAW file needs the size of the sensor, and nothing tells it: add --geometry "
        "WIDTHxHEIGHT");
  }
  if (ending == ".h5" || ending == ".hdf5") {
    return CreateHdf5EventWriter(
        path, front, layout == "events" ? Hdf5EventLayout::kColumns : Hdf5EventLayout::kCompound);
  }
  return UnknownEnding(ending);
}

}  // namespace rigcal::agent
